/* FMI 2.0 around MODEL.h: Model Exchange, and Co-Simulation if there is a step. The types and functions are those of
 * the standard's headers (fmi-standard.org); only what this file uses of them is declared. */
#include <stdarg.h>

typedef int fmi2Boolean;
typedef unsigned int fmi2ValueReference;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
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

#define API __attribute__((visibility("default")))
#define N MODEL_STATES
enum { STATE = 0, RATE = N, NUMBER = 2 * N, OUTPUT = 2 * N + MODEL_NUMBERS, STEP_SIZE = OUTPUT + MODEL_OUTPUTS };
enum { INSTANTIATED = 1, INITIALISING = 2, EVENTS = 4, CONTINUOUS = 8, STEPPING = 16, FAILED = 32, ENDED = 64 };
enum { STALE, RATES_KNOWN, ALL_KNOWN };

/* What is saved and restored; numbers only. */
typedef struct {
    uint64_t guid;
    int phase, started, set, drifted;
    double t, last, step, tolerance, y[N], number[MODEL_NUMBERS + 1], remembered[MODEL_REMEMBERED + 1];
} Values;

typedef struct {
    MODEL_instance model;
    Values v;
    double dy[N], out[MODEL_OUTPUTS];
    int known, differentiated, logging, is_cs;
    double reached;
    fmi2CallbackFunctions call;
    char name[128];
} Instance;

static fmi2Status fail(Instance *c, const char *text) {
    if (c->call.logger) c->call.logger(c->call.componentEnvironment, c->name, fmi2Error, "logStatusError", "%s", text);
    return fmi2Error;
}

static fmi2Status failed(Instance *c, int status) {
    char text[600];
    MODEL_message(&c->model, status, text, sizeof text);
    return fail(c, text);
}

static fmi2Status out_of_order(Instance *c, const char *function) {
    char text[200];
    snprintf(text, sizeof text, "%s is not allowed now: see the calling sequences of FMI 2.0", function);
    return fail(c, text);
}

#define IN(phases) \
    Instance *c = component; \
    if (!c) return fmi2Error; \
    if (!(c->v.phase & (phases))) return out_of_order(c, __func__)

/* Nothing is known of the present time, state and numbers. */
static void stale(Instance *c) {
    c->known = STALE;
    c->differentiated = 0;
}

static void begin(Instance *c) {
    MODEL_init(&c->model);
    memset(&c->v, 0, sizeof c->v);
    memcpy(&c->v.guid, MODEL_GUID, sizeof c->v.guid);
    memcpy(c->v.y, MODEL_state_start, sizeof c->v.y);
    memcpy(c->v.number, MODEL_number_start, MODEL_NUMBERS * sizeof(double));
    c->v.step = STEP;
    c->v.tolerance = 1e-8; /* as modelDescription.xml says */
    c->v.last = INFINITY;
    c->v.phase = INSTANTIATED;
    stale(c);
}

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }

API void *fmi2Instantiate(const char *name, fmi2Type type, const char *guid, const char *place,
                          const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging) {
    (void)place, (void)visible;
    if (!call || !call->allocateMemory || !call->freeMemory) return NULL;
    const char *wrong = NULL;
    if (!guid || strcmp(guid, MODEL_GUID))
        wrong = "the library and modelDescription.xml are of different models: the archive is damaged, or was put "
                "together from others; export the scene again";
    else if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") || !__builtin_cpu_supports("bmi2"))
        wrong = "this processor lacks AVX2 or fused multiply-add, for which the model is compiled (x86-64-v3)";
    else if (type == fmi2CoSimulation && !(STEP > 0.0))
        wrong = "this model was exported for Model Exchange only: export it with --step for Co-Simulation";
    if (wrong) {
        if (call->logger) call->logger(call->componentEnvironment, name, fmi2Error, "logStatusError", "%s", wrong);
        return NULL;
    }
    Instance *c = call->allocateMemory(1, sizeof(Instance));
    if (!c) return NULL;
    begin(c);
    c->call = *call;
    c->logging = logging;
    c->is_cs = type == fmi2CoSimulation;
    snprintf(c->name, sizeof c->name, "%s", name ? name : "");
    return c;
}

API void fmi2FreeInstance(void *component) {
    Instance *c = component;
    if (c) c->call.freeMemory(c);
}

API fmi2Status fmi2SetDebugLogging(void *component, fmi2Boolean on, size_t count, const char *const categories[]) {
    (void)count, (void)categories;
    IN(~0);
    c->logging = on;
    return fmi2OK;
}

API fmi2Status fmi2SetupExperiment(void *component, fmi2Boolean has_tolerance, double tolerance, double start,
                                   fmi2Boolean has_stop, double stop) {
    (void)has_stop, (void)stop;
    IN(INSTANTIATED);
    if (has_tolerance && tolerance > 0.0) c->v.tolerance = tolerance;
    c->v.t = start;
    return fmi2OK;
}

API fmi2Status fmi2EnterInitializationMode(void *component) {
    IN(INSTANTIATED);
    c->v.phase = INITIALISING;
    return fmi2OK;
}

/* Prescribed motions have their values, quaternions unit length, and loops are closed, from the start on. */
static fmi2Status settle(Instance *c) {
    MODEL_segment(&c->model, c->v.t);
    c->v.last = c->model.last;
    const int status = MODEL_begin(&c->model, c->v.t, c->v.y);
    stale(c);
    return status ? failed(c, status) : fmi2OK;
}

API fmi2Status fmi2ExitInitializationMode(void *component) {
    IN(INITIALISING);
    if (settle(c) != fmi2OK) return fmi2Error;
    c->v.started = 1;
    c->v.set = 0;
    c->v.phase = c->is_cs ? STEPPING : EVENTS;
    return fmi2OK;
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

/* Failures of states too far from the last step's, which a shorter one does not reach. */
static int shorter(int status) { return MODEL_REMEMBERED && (status == SINGULAR || status == BRANCH); }

static fmi2Status know(Instance *c, int what) {
    if (c->known >= what) return fmi2OK;
    int status = what == ALL_KNOWN ? MODEL_outputs(&c->model, c->v.t, c->v.y, c->dy, c->out)
                                   : MODEL_rhs(&c->model, c->v.t, c->v.y, c->dy);
    if (status) {
        failed(c, status);
        return shorter(status) && c->v.phase == CONTINUOUS ? fmi2Discard : fmi2Error;
    }
    c->known = what;
    return fmi2OK;
}

API fmi2Status fmi2GetReal(void *component, const fmi2ValueReference vr[], size_t count, double value[]) {
    IN(~0);
    for (size_t i = 0; i < count; i++) {
        const unsigned int r = vr[i];
        if (c->v.phase == INITIALISING && (r < NUMBER || (r >= OUTPUT && r < STEP_SIZE))) {
            const int known = c->known;
            if (settle(c) != fmi2OK) return fmi2Error;
            c->known = known;
        }
        if (r < RATE)
            value[i] = c->v.y[r];
        else if (r < NUMBER) {
            const fmi2Status status = know(c, RATES_KNOWN);
            if (status != fmi2OK) return status;
            value[i] = c->dy[r - RATE];
        } else if (r < OUTPUT)
            value[i] = c->v.number[r - NUMBER];
        else if (r < STEP_SIZE) {
            const fmi2Status status = know(c, ALL_KNOWN);
            if (status != fmi2OK) return status;
            value[i] = c->out[r - OUTPUT];
        } else if (r == STEP_SIZE && STEP > 0.0)
            value[i] = c->v.step;
        else
            return fail(c, "there is no real variable of this value reference");
    }
    return fmi2OK;
}

API fmi2Status fmi2SetReal(void *component, const fmi2ValueReference vr[], size_t count, const double value[]) {
    IN(INSTANTIATED | INITIALISING | EVENTS | CONTINUOUS | STEPPING);
    for (size_t i = 0; i < count; i++) {
        const unsigned int r = vr[i];
        if (!isfinite(value[i])) return fail(c, "a value that is set is not finite");
        if (r < RATE) {
            if (c->v.started && !c->is_cs) return fail(c, "states are set by fmi2SetContinuousStates after the start");
            c->v.y[r] = value[i];
            c->v.set = 1;
        } else if (r >= NUMBER && r < OUTPUT) {
            c->v.number[r - NUMBER] = value[i];
            MODEL_set(&c->model, (int)(r - NUMBER), value[i]);
        } else if (r == STEP_SIZE && STEP > 0.0) {
            if (c->v.started || !(value[i] > 0.0)) return fail(c, "the step is positive, and set before the start");
            c->v.step = value[i];
        } else
            return fail(c, "no real variable of this value reference can be set");
        stale(c);
    }
    return fmi2OK;
}

static fmi2Status none(void *component, size_t count) {
    IN(~0);
    return count ? fail(c, "this model has real variables only") : fmi2OK;
}

API fmi2Status fmi2GetInteger(void *k, const fmi2ValueReference *r, size_t n, int *v) { (void)r, (void)v; return none(k, n); }
API fmi2Status fmi2GetBoolean(void *k, const fmi2ValueReference *r, size_t n, int *v) { (void)r, (void)v; return none(k, n); }
API fmi2Status fmi2GetString(void *k, const fmi2ValueReference *r, size_t n, const char **v) { (void)r, (void)v; return none(k, n); }
API fmi2Status fmi2SetInteger(void *k, const fmi2ValueReference *r, size_t n, const int *v) { (void)r, (void)v; return none(k, n); }
API fmi2Status fmi2SetBoolean(void *k, const fmi2ValueReference *r, size_t n, const int *v) { (void)r, (void)v; return none(k, n); }
API fmi2Status fmi2SetString(void *k, const fmi2ValueReference *r, size_t n, const char *const *v) { (void)r, (void)v; return none(k, n); }

static void restore(Instance *c, const Values *v) {
    c->v = *v;
    for (int i = 0; i < MODEL_NUMBERS; i++) MODEL_set(&c->model, i, v->number[i]);
    MODEL_recall(&c->model, v->remembered);
    c->model.last = v->last;
    stale(c);
}

API fmi2Status fmi2GetFMUstate(void *component, void **state) {
    IN(~0);
    if (!*state) *state = c->call.allocateMemory(1, sizeof(Values));
    if (!*state) return fail(c, "there is no memory for the state");
    MODEL_remember(&c->model, c->v.remembered);
    memcpy(*state, &c->v, sizeof(Values));
    return fmi2OK;
}

API fmi2Status fmi2SetFMUstate(void *component, void *state) {
    IN(~0);
    if (!state) return fail(c, "there is no state to be set");
    restore(c, state);
    return fmi2OK;
}

API fmi2Status fmi2FreeFMUstate(void *component, void **state) {
    IN(~0);
    if (*state) c->call.freeMemory(*state);
    *state = NULL;
    return fmi2OK;
}

API fmi2Status fmi2SerializedFMUstateSize(void *component, void *state, size_t *size) {
    (void)state;
    IN(~0);
    *size = sizeof(Values);
    return fmi2OK;
}

API fmi2Status fmi2SerializeFMUstate(void *component, void *state, char bytes[], size_t size) {
    IN(~0);
    if (!state || size < sizeof(Values)) return fail(c, "the place for the state is too small");
    memcpy(bytes, state, sizeof(Values));
    return fmi2OK;
}

API fmi2Status fmi2DeSerializeFMUstate(void *component, const char bytes[], size_t size, void **state) {
    IN(~0);
    uint64_t guid = 0;
    memcpy(&guid, MODEL_GUID, sizeof guid);
    if (size != sizeof(Values) || memcmp(bytes, &guid, sizeof guid)) return fail(c, "this is a state of another model");
    if (!*state) *state = c->call.allocateMemory(1, sizeof(Values));
    if (!*state) return fail(c, "there is no memory for the state");
    memcpy(*state, bytes, sizeof(Values));
    return fmi2OK;
}

#if MODEL_DERIVATIVES
/* The place of a variable in the direction; NULL, with a message, if nothing is differentiated by it. */
static double *known_at(Instance *c, unsigned int r, double *state, double *input) {
    if (r < RATE) return state + r;
    if (r >= NUMBER && r < NUMBER + MODEL_INPUTS) return input + (r - NUMBER);
    char text[300];
    const char *name = r >= NUMBER && r < OUTPUT ? MODEL_number_names[r - NUMBER] : "this variable";
    snprintf(text, sizeof text, "derivatives are by states and inputs, not by %s", name);
    fail(c, text);
    return NULL;
}
#endif

API fmi2Status fmi2GetDirectionalDerivative(void *component, const fmi2ValueReference *z, size_t nz,
                                            const fmi2ValueReference *v, size_t nv, const double *dv, double *dz) {
    IN(INITIALISING | EVENTS | CONTINUOUS | STEPPING);
#if MODEL_DERIVATIVES
    double state[N] = {0.0}, input[MODEL_INPUTS + 1] = {0.0}, rates[N], out[MODEL_OUTPUTS];
    int seen = 0;
    for (size_t i = 0; i < nv; i++) {
        double *place = known_at(c, v[i], state, input);
        if (!place) return fmi2Error;
        *place += dv[i];
    }
    for (size_t i = 0; i < nz; i++) {
        if (z[i] >= STEP_SIZE || (z[i] >= NUMBER && z[i] < OUTPUT))
            return fail(c, "derivatives are of states, their rates and outputs, not of inputs and parameters");
        seen |= z[i] >= OUTPUT;
    }
    if (c->v.phase == INITIALISING && settle(c) != fmi2OK) return fmi2Error;
    const int status = MODEL_along(&c->model, c->v.t, c->v.y, !c->differentiated, state, input, rates, seen ? out : NULL);
    c->differentiated = !status;
    if (status) return failed(c, status);
    for (size_t i = 0; i < nz; i++)
        dz[i] = z[i] < RATE ? state[z[i]] : z[i] < NUMBER ? rates[z[i] - RATE] : out[z[i] - OUTPUT];
    return fmi2OK;
#else
    (void)z, (void)nz, (void)v, (void)nv, (void)dv, (void)dz;
    return fail(c, "this model provides no directional derivatives: export it with --derivatives");
#endif
}

/* Model Exchange */

API fmi2Status fmi2EnterEventMode(void *component) {
    IN(EVENTS | CONTINUOUS);
    c->v.phase = EVENTS;
    return fmi2OK;
}

API fmi2Status fmi2NewDiscreteStates(void *component, fmi2EventInfo *info) {
    IN(EVENTS);
    const double next = MODEL_next_switch(c->v.t);
    MODEL_segment(&c->model, c->v.t);
    c->v.last = c->model.last;
    stale(c);
    memset(info, 0, sizeof *info);
    if (c->v.drifted) {
        const int status = MODEL_settle(&c->model, c->v.t, c->v.y);
        if (status) return failed(c, status);
        c->v.drifted = 0;
        info->valuesOfContinuousStatesChanged = 1;
    }
    info->nextEventTimeDefined = !isinf(next);
    info->nextEventTime = isinf(next) ? 0.0 : next;
    return fmi2OK;
}

API fmi2Status fmi2EnterContinuousTimeMode(void *component) {
    IN(EVENTS);
    c->v.phase = CONTINUOUS;
    return fmi2OK;
}

API fmi2Status fmi2CompletedIntegratorStep(void *component, fmi2Boolean keeps, fmi2Boolean *events, fmi2Boolean *ends) {
    (void)keeps;
    IN(CONTINUOUS);
    *events = *ends = 0;
    if (!MODEL_REMEMBERED) return fmi2OK;
    double closed[N];
    memcpy(closed, c->v.y, sizeof closed);
    const int status = MODEL_settle(&c->model, c->v.t, closed);
    if (status) return failed(c, status);
    for (int i = 0; i < N; i++)
        if (fabs(closed[i] - c->v.y[i]) > c->v.tolerance * fmax(1.0, fabs(closed[i]))) c->v.drifted = *events = 1;
    stale(c);
    return fmi2OK;
}

API fmi2Status fmi2SetTime(void *component, double t) {
    IN(EVENTS | CONTINUOUS);
    if (t != c->v.t) stale(c);
    c->v.t = t;
    return fmi2OK;
}

API fmi2Status fmi2SetContinuousStates(void *component, const double y[], size_t count) {
    IN(EVENTS | CONTINUOUS);
    if (count != N) return fail(c, "the number of states is another one");
    memcpy(c->v.y, y, sizeof c->v.y);
    stale(c);
    return fmi2OK;
}

API fmi2Status fmi2GetDerivatives(void *component, double dy[], size_t count) {
    IN(INITIALISING | EVENTS | CONTINUOUS);
    if (count != N) return fail(c, "the number of states is another one");
    const fmi2Status status = know(c, RATES_KNOWN);
    if (status != fmi2OK) return status;
    memcpy(dy, c->dy, sizeof c->dy);
    return fmi2OK;
}

API fmi2Status fmi2GetEventIndicators(void *component, double indicators[], size_t count) {
    (void)indicators;
    IN(~0);
    return count ? fail(c, "this model has no event indicators") : fmi2OK;
}

API fmi2Status fmi2GetContinuousStates(void *component, double y[], size_t count) {
    IN(INITIALISING | EVENTS | CONTINUOUS);
    if (count != N) return fail(c, "the number of states is another one");
    memcpy(y, c->v.y, sizeof c->v.y);
    return fmi2OK;
}

API fmi2Status fmi2GetNominalsOfContinuousStates(void *component, double nominal[], size_t count) {
    IN(~0);
    if (count != N) return fail(c, "the number of states is another one");
    for (size_t i = 0; i < count; i++) nominal[i] = 1.0;
    return fmi2OK;
}

/* Co-Simulation */

API fmi2Status fmi2DoStep(void *component, double t, double size, fmi2Boolean keeps) {
    (void)keeps;
    IN(STEPPING);
    if (!(size > 0.0)) return fail(c, "a communication step is positive");
    c->v.t = t;
    int status = c->v.set && MODEL_REMEMBERED ? MODEL_begin(&c->model, t, c->v.y) : 0;
    c->v.set = 0;
    if (!status) status = MODEL_run(&c->model, t, t + size, c->v.step, c->v.y, &c->v.t);
    c->v.last = c->model.last;
    c->reached = c->v.t;
    stale(c);
    if (status) {
        c->v.phase = FAILED;
        return failed(c, status);
    }
    return fmi2OK;
}

API fmi2Status fmi2CancelStep(void *component) {
    IN(~0);
    return fail(c, "steps are not asynchronous");
}

API fmi2Status fmi2SetRealInputDerivatives(void *k, const fmi2ValueReference *r, size_t n, const int *o, const double *v) {
    (void)r, (void)o, (void)v;
    return none(k, n);
}

API fmi2Status fmi2GetRealOutputDerivatives(void *k, const fmi2ValueReference *r, size_t n, const int *o, double *v) {
    (void)r, (void)o, (void)v;
    return none(k, n);
}

API fmi2Status fmi2GetStatus(void *component, fmi2StatusKind kind, fmi2Status *value) {
    (void)kind, (void)value;
    IN(~0);
    return fmi2Discard;
}

API fmi2Status fmi2GetRealStatus(void *component, fmi2StatusKind kind, double *value) {
    IN(~0);
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = c->reached;
    return fmi2OK;
}

API fmi2Status fmi2GetIntegerStatus(void *component, fmi2StatusKind kind, int *value) {
    (void)kind, (void)value;
    IN(~0);
    return fmi2Discard;
}

API fmi2Status fmi2GetBooleanStatus(void *component, fmi2StatusKind kind, fmi2Boolean *value) {
    IN(~0);
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = 0;
    return fmi2OK;
}

API fmi2Status fmi2GetStringStatus(void *component, fmi2StatusKind kind, const char **value) {
    (void)kind, (void)value;
    IN(~0);
    return fmi2Discard;
}
