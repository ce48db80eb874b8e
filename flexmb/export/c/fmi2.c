/* FMI 2.0 around an instance: Model Exchange, and Co-Simulation if there is a step. The types and functions are those of
 * the standard's headers (fmi-standard.org); only what this file uses of them is declared. */

typedef int fmi2Boolean, fmi2Status;
typedef unsigned int fmi2ValueReference;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2StatusNumber;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged,
        valuesOfContinuousStatesChanged, nextEventTimeDefined;
    double nextEventTime;
} fmi2EventInfo;
typedef struct {
    void (*logger)(void *, const char *, fmi2Status, const char *, const char *, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, fmi2Status);
    void *componentEnvironment;
} fmi2CallbackFunctions;

typedef fmi2CallbackFunctions Host;

static void tell(const Host *host, const char *name, const char *text) {
    if (host->logger) host->logger(host->componentEnvironment, name, fmi2Error, "logStatusError", "%s", text);
}
static void *reserve(const Host *host, size_t size) { return host->allocateMemory(1, size); }
static void release(const Host *host, void *memory) { host->freeMemory(memory); }

#include "instance.c"

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }

API void *fmi2Instantiate(const char *name, fmi2Type type, const char *guid, const char *place,
                          const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging) {
    (void)place, (void)visible, (void)logging;
    if (!call || !call->allocateMemory || !call->freeMemory) return NULL;
    return created(call, name, guid, type == fmi2CoSimulation);
}

API void fmi2FreeInstance(void *component) {
    Instance *c = component;
    if (c) release(&c->host, c);
}

API fmi2Status fmi2SetDebugLogging(void *component, fmi2Boolean on, size_t count, const char *const categories[]) {
    (void)on, (void)count, (void)categories;
    IN(~0);
    return fmi2OK;
}

API fmi2Status fmi2SetupExperiment(void *component, fmi2Boolean has_tolerance, double tolerance, double start,
                                   fmi2Boolean has_stop, double stop) {
    (void)has_stop, (void)stop;
    IN(INSTANTIATED);
    return set_up(c, has_tolerance, tolerance, start);
}

API fmi2Status fmi2EnterInitializationMode(void *component) {
    IN(INSTANTIATED);
    c->v.phase = INITIALISING;
    return fmi2OK;
}

API fmi2Status fmi2ExitInitializationMode(void *component) {
    IN(INITIALISING);
    return initialised(c);
}

API fmi2Status fmi2Terminate(void *component) {
    IN(EVENTS | CONTINUOUS | STEPPING | FAILED);
    c->v.phase = ENDED;
    return fmi2OK;
}

API fmi2Status fmi2Reset(void *component) {
    IN(~0);
    begin(c);
    return fmi2OK;
}

API fmi2Status fmi2GetReal(void *component, const fmi2ValueReference vr[], size_t count, double value[]) {
    IN(~0);
    return get(c, vr, count, value);
}

API fmi2Status fmi2SetReal(void *component, const fmi2ValueReference vr[], size_t count, const double value[]) {
    IN(INSTANTIATED | INITIALISING | EVENTS | CONTINUOUS | STEPPING);
    return set(c, vr, count, value);
}

#define NONE(name, value_type) \
    API fmi2Status name(void *component, const fmi2ValueReference *vr, size_t count, value_type value) { \
        (void)vr, (void)value; \
        IN(~0); \
        return none(c, count); \
    }
NONE(fmi2GetInteger, int *)
NONE(fmi2GetBoolean, int *)
NONE(fmi2GetString, const char **)
NONE(fmi2SetInteger, const int *)
NONE(fmi2SetBoolean, const int *)
NONE(fmi2SetString, const char *const *)

API fmi2Status fmi2GetFMUstate(void *component, void **state) {
    IN(~0);
    return save(c, state);
}

API fmi2Status fmi2SetFMUstate(void *component, void *state) {
    IN(~0);
    return restore(c, state);
}

API fmi2Status fmi2FreeFMUstate(void *component, void **state) {
    IN(~0);
    return forget_saved(c, state);
}

API fmi2Status fmi2SerializedFMUstateSize(void *component, void *state, size_t *size) {
    (void)state;
    IN(~0);
    *size = sizeof(Values);
    return fmi2OK;
}

API fmi2Status fmi2SerializeFMUstate(void *component, void *state, char bytes[], size_t size) {
    IN(~0);
    return write_saved(c, state, bytes, size);
}

API fmi2Status fmi2DeSerializeFMUstate(void *component, const char bytes[], size_t size, void **state) {
    IN(~0);
    return read_saved(c, bytes, size, state);
}

API fmi2Status fmi2GetDirectionalDerivative(void *component, const fmi2ValueReference *z, size_t nz,
                                            const fmi2ValueReference *v, size_t nv, const double *dv, double *dz) {
    IN(INITIALISING | EVENTS | CONTINUOUS | STEPPING);
    return along(c, z, nz, v, nv, dv, dz);
}

/* Model Exchange */

API fmi2Status fmi2EnterEventMode(void *component) {
    IN(EVENTS | CONTINUOUS);
    c->v.phase = EVENTS;
    return fmi2OK;
}

API fmi2Status fmi2NewDiscreteStates(void *component, fmi2EventInfo *info) {
    IN(EVENTS);
    double next;
    memset(info, 0, sizeof *info);
    const int status = updated(c, &info->valuesOfContinuousStatesChanged, &next);
    info->nextEventTimeDefined = !isinf(next);
    info->nextEventTime = isinf(next) ? 0.0 : next;
    return status;
}

API fmi2Status fmi2EnterContinuousTimeMode(void *component) {
    IN(EVENTS);
    c->v.phase = CONTINUOUS;
    return fmi2OK;
}

API fmi2Status fmi2CompletedIntegratorStep(void *component, fmi2Boolean keeps, fmi2Boolean *events, fmi2Boolean *ends) {
    (void)keeps;
    IN(CONTINUOUS);
    *ends = 0;
    return completed(c, events);
}

API fmi2Status fmi2SetTime(void *component, double t) {
    IN(EVENTS | CONTINUOUS);
    return set_time(c, t);
}

API fmi2Status fmi2SetContinuousStates(void *component, const double y[], size_t count) {
    IN(EVENTS | CONTINUOUS);
    return set_states(c, y, count);
}

API fmi2Status fmi2GetDerivatives(void *component, double dy[], size_t count) {
    IN(INITIALISING | EVENTS | CONTINUOUS);
    return get_rates(c, dy, count);
}

API fmi2Status fmi2GetEventIndicators(void *component, double values[], size_t count) {
    (void)values;
    IN(~0);
    return indicators(c, count);
}

API fmi2Status fmi2GetContinuousStates(void *component, double y[], size_t count) {
    IN(INITIALISING | EVENTS | CONTINUOUS);
    return get_states(c, y, count);
}

API fmi2Status fmi2GetNominalsOfContinuousStates(void *component, double nominal[], size_t count) {
    IN(~0);
    return nominals(c, nominal, count);
}

/* Co-Simulation */

API fmi2Status fmi2DoStep(void *component, double t, double size, fmi2Boolean keeps) {
    (void)keeps;
    IN(STEPPING);
    return step(c, t, size);
}

API fmi2Status fmi2CancelStep(void *component) {
    IN(~0);
    return fail(c, "steps are not asynchronous");
}

API fmi2Status fmi2SetRealInputDerivatives(void *component, const fmi2ValueReference *vr, size_t count, const int *order,
                                           const double *value) {
    (void)vr, (void)order, (void)value;
    IN(~0);
    return none(c, count);
}

API fmi2Status fmi2GetRealOutputDerivatives(void *component, const fmi2ValueReference *vr, size_t count, const int *order,
                                            double *value) {
    (void)vr, (void)order, (void)value;
    IN(~0);
    return none(c, count);
}

#define NO_STATUS(name, value_type) \
    API fmi2Status name(void *component, fmi2StatusKind kind, value_type *value) { \
        (void)kind, (void)value; \
        IN(~0); \
        return fmi2Discard; \
    }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetIntegerStatus, int)
NO_STATUS(fmi2GetStringStatus, const char *)

API fmi2Status fmi2GetRealStatus(void *component, fmi2StatusKind kind, double *value) {
    IN(~0);
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = c->reached;
    return fmi2OK;
}

API fmi2Status fmi2GetBooleanStatus(void *component, fmi2StatusKind kind, fmi2Boolean *value) {
    IN(~0);
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = 0;
    return fmi2OK;
}
