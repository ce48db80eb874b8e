/* FMI 3.0 around an instance: Model Exchange, and Co-Simulation if there is a step. The types and functions are those of
 * the standard's headers (fmi-standard.org); only what this file uses of them is declared. */
#include <stdbool.h>
#include <stdlib.h>

typedef int fmi3Status;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3StatusNumber;
typedef unsigned int fmi3ValueReference;
typedef void (*fmi3LogMessageCallback)(void *, fmi3Status, const char *, const char *);

typedef struct {
    void *environment;
    fmi3LogMessageCallback log;
} Host;

static void tell(const Host *host, const char *name, const char *text) {
    (void)name;
    if (host->log) host->log(host->environment, fmi3Error, "logStatusError", text);
}
static void *reserve(const Host *host, size_t size) { return (void)host, calloc(1, size); }
static void release(const Host *host, void *memory) { (void)host, free(memory); }

#include "instance.c"

API const char *fmi3GetVersion(void) { return "3.0"; }

API void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *place, bool visible, bool logging,
                                       void *environment, fmi3LogMessageCallback log) {
    (void)place, (void)visible, (void)logging;
    return created(&(Host){environment, log}, name, token, 0);
}

API void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *place, bool visible, bool logging,
                                      bool events, bool early, const fmi3ValueReference *between, size_t count,
                                      void *environment, fmi3LogMessageCallback log, void *update) {
    (void)place, (void)visible, (void)logging, (void)events, (void)early, (void)between, (void)count, (void)update;
    return created(&(Host){environment, log}, name, token, 1);
}

API void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *place, bool visible,
                                            bool logging, void *environment, fmi3LogMessageCallback log, void *update,
                                            void *lock, void *unlock) {
    (void)token, (void)place, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    tell(&(Host){environment, log}, name, "this model has no partitions: it is for Model Exchange or Co-Simulation");
    return NULL;
}

API void fmi3FreeInstance(void *component) { free(component); }

API fmi3Status fmi3SetDebugLogging(void *component, bool on, size_t count, const char *const categories[]) {
    (void)on, (void)count, (void)categories;
    IN(~0);
    return fmi3OK;
}

API fmi3Status fmi3EnterInitializationMode(void *component, bool has_tolerance, double tolerance, double start,
                                           bool has_stop, double stop) {
    (void)has_stop, (void)stop;
    IN(INSTANTIATED);
    const int status = set_up(c, has_tolerance, tolerance, start);
    if (status == DONE) c->v.phase = INITIALISING;
    return status;
}

API fmi3Status fmi3ExitInitializationMode(void *component) {
    IN(INITIALISING);
    return initialised(c);
}

API fmi3Status fmi3Terminate(void *component) {
    IN(EVENTS | CONTINUOUS | STEPPING | FAILED);
    c->v.phase = ENDED;
    return fmi3OK;
}

API fmi3Status fmi3Reset(void *component) {
    IN(~0);
    begin(c);
    return fmi3OK;
}

API fmi3Status fmi3GetFloat64(void *component, const fmi3ValueReference vr[], size_t count, double value[], size_t values) {
    IN(~0);
    if (count != values) return fail(c, "all variables are scalars, with one value each");
    return get(c, vr, count, value);
}

API fmi3Status fmi3SetFloat64(void *component, const fmi3ValueReference vr[], size_t count, const double value[],
                              size_t values) {
    IN(INSTANTIATED | INITIALISING | EVENTS | CONTINUOUS | STEPPING);
    if (count != values) return fail(c, "all variables are scalars, with one value each");
    return set(c, vr, count, value);
}

#define NONE(name, ...) \
    API fmi3Status name(void *component, const fmi3ValueReference vr[], size_t count, __VA_ARGS__) { \
        (void)vr; \
        IN(~0); \
        return none(c, count); \
    }
#pragma GCC diagnostic ignored "-Wunused-parameter"
#define NO_TYPE(type, kind) \
    NONE(fmi3Get##type, kind value[], size_t values) \
    NONE(fmi3Set##type, const kind value[], size_t values)
NO_TYPE(Float32, float)
NO_TYPE(Int8, int8_t)
NO_TYPE(UInt8, uint8_t)
NO_TYPE(Int16, int16_t)
NO_TYPE(UInt16, uint16_t)
NO_TYPE(Int32, int32_t)
NO_TYPE(UInt32, uint32_t)
NO_TYPE(Int64, int64_t)
NO_TYPE(UInt64, uint64_t)
NO_TYPE(Boolean, bool)
NO_TYPE(String, char *)
NONE(fmi3GetBinary, size_t sizes[], const uint8_t *value[], size_t values)
NONE(fmi3SetBinary, const size_t sizes[], const uint8_t *const value[], size_t values)
NONE(fmi3GetClock, bool value[])
NONE(fmi3SetClock, const bool value[])
NONE(fmi3GetIntervalDecimal, double intervals[], int qualifiers[])
NONE(fmi3GetIntervalFraction, uint64_t counters[], uint64_t resolutions[], int qualifiers[])
NONE(fmi3GetShiftDecimal, double shifts[])
NONE(fmi3GetShiftFraction, uint64_t counters[], uint64_t resolutions[])
NONE(fmi3SetIntervalDecimal, const double intervals[])
NONE(fmi3SetIntervalFraction, const uint64_t counters[], const uint64_t resolutions[])
NONE(fmi3SetShiftDecimal, const double shifts[])
NONE(fmi3SetShiftFraction, const uint64_t counters[], const uint64_t resolutions[])
NONE(fmi3GetOutputDerivatives, const int32_t orders[], double value[], size_t values)

#define NOT_HERE(name, text, ...) \
    API fmi3Status name(__VA_ARGS__) { \
        IN(~0); \
        return fail(c, text); \
    }
NOT_HERE(fmi3GetNumberOfVariableDependencies, "there are no arrays, whose dependencies could change", void *component,
         fmi3ValueReference vr, size_t *count)
NOT_HERE(fmi3GetVariableDependencies, "there are no arrays, whose dependencies could change", void *component,
         fmi3ValueReference dependent, size_t elements[], fmi3ValueReference independents[], size_t others[], int kinds[],
         size_t count)
NOT_HERE(fmi3EnterConfigurationMode, "this model has no structural parameters", void *component)
NOT_HERE(fmi3ExitConfigurationMode, "this model has no structural parameters", void *component)
NOT_HERE(fmi3EnterStepMode, "this model has no event mode in Co-Simulation", void *component)
NOT_HERE(fmi3ActivateModelPartition, "this model has no partitions", void *component, fmi3ValueReference clock, double t)
NOT_HERE(fmi3GetAdjointDerivative, "this model provides directional, but no adjoint derivatives", void *component,
         const fmi3ValueReference z[], size_t nz, const fmi3ValueReference v[], size_t nv, const double dz[],
         size_t seeds, double dv[], size_t values)

API fmi3Status fmi3GetFMUState(void *component, void **state) {
    IN(~0);
    return save(c, state);
}

API fmi3Status fmi3SetFMUState(void *component, void *state) {
    IN(~0);
    return restore(c, state);
}

API fmi3Status fmi3FreeFMUState(void *component, void **state) {
    IN(~0);
    return forget_saved(c, state);
}

API fmi3Status fmi3SerializedFMUStateSize(void *component, void *state, size_t *size) {
    IN(~0);
    *size = sizeof(Values);
    return fmi3OK;
}

API fmi3Status fmi3SerializeFMUState(void *component, void *state, uint8_t bytes[], size_t size) {
    IN(~0);
    return write_saved(c, state, bytes, size);
}

API fmi3Status fmi3DeserializeFMUState(void *component, const uint8_t bytes[], size_t size, void **state) {
    IN(~0);
    return read_saved(c, bytes, size, state);
}

API fmi3Status fmi3GetDirectionalDerivative(void *component, const fmi3ValueReference z[], size_t nz,
                                            const fmi3ValueReference v[], size_t nv, const double dv[], size_t seeds,
                                            double dz[], size_t values) {
    IN(INITIALISING | EVENTS | CONTINUOUS | STEPPING);
    if (seeds != nv || values != nz) return fail(c, "all variables are scalars, with one value each");
    return along(c, z, nz, v, nv, dv, dz);
}

/* Model Exchange */

API fmi3Status fmi3EnterEventMode(void *component) {
    IN(EVENTS | CONTINUOUS);
    c->v.phase = EVENTS;
    return fmi3OK;
}

API fmi3Status fmi3EvaluateDiscreteStates(void *component) {
    IN(INITIALISING | EVENTS);
    return fmi3OK;
}

API fmi3Status fmi3UpdateDiscreteStates(void *component, bool *again, bool *ends, bool *other_nominals, bool *other_states,
                                        bool *has_next, double *next) {
    IN(EVENTS);
    int moved;
    const int status = updated(c, &moved, next);
    *again = *ends = *other_nominals = false;
    *other_states = moved;
    *has_next = !isinf(*next);
    if (!*has_next) *next = 0.0;
    return status;
}

API fmi3Status fmi3EnterContinuousTimeMode(void *component) {
    IN(EVENTS);
    c->v.phase = CONTINUOUS;
    return fmi3OK;
}

API fmi3Status fmi3CompletedIntegratorStep(void *component, bool keeps, bool *events, bool *ends) {
    IN(CONTINUOUS);
    int asks;
    const int status = completed(c, &asks);
    *events = asks;
    *ends = false;
    return status;
}

API fmi3Status fmi3SetTime(void *component, double t) {
    IN(EVENTS | CONTINUOUS);
    return set_time(c, t);
}

API fmi3Status fmi3SetContinuousStates(void *component, const double y[], size_t count) {
    IN(EVENTS | CONTINUOUS);
    return set_states(c, y, count);
}

API fmi3Status fmi3GetContinuousStateDerivatives(void *component, double dy[], size_t count) {
    IN(INITIALISING | EVENTS | CONTINUOUS);
    return get_rates(c, dy, count);
}

API fmi3Status fmi3GetEventIndicators(void *component, double values[], size_t count) {
    IN(~0);
    return indicators(c, count);
}

API fmi3Status fmi3GetContinuousStates(void *component, double y[], size_t count) {
    IN(INITIALISING | EVENTS | CONTINUOUS);
    return get_states(c, y, count);
}

API fmi3Status fmi3GetNominalsOfContinuousStates(void *component, double nominal[], size_t count) {
    IN(~0);
    return nominals(c, nominal, count);
}

API fmi3Status fmi3GetNumberOfEventIndicators(void *component, size_t *count) {
    IN(~0);
    *count = 0;
    return fmi3OK;
}

API fmi3Status fmi3GetNumberOfContinuousStates(void *component, size_t *count) {
    IN(~0);
    *count = N;
    return fmi3OK;
}

/* Co-Simulation */

API fmi3Status fmi3DoStep(void *component, double t, double size, bool keeps, bool *events, bool *ends, bool *early,
                          double *reached) {
    IN(STEPPING);
    *events = *ends = *early = false;
    const int status = step(c, t, size);
    *reached = c->reached;
    return status;
}
