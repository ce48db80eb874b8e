/* A pendulum as somebody else would have written it: grams, millimetres, degrees, the angle counted the other way.
 * One source for FMI 2.0 and, with -DFMI3, for FMI 3.0; Model Exchange and Co-Simulation. Written by hand, without the
 * headers of the standard, so that nothing of the adapter or of FMPy takes part in it.
 *
 * x[0] is the angle in deg, x[1] its rate in deg/s. Value references are those of the enumeration below. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef void *Component;
typedef unsigned int Reference;
typedef int Status;
enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum {
    PHI, OMEGA, DPHI, DOMEGA, MASS, LENGTH, INERTIA, GRAVITY, TORQUE, STEP, FAULT, WALL, TOTAL_INERTIA, FORCE_X, FORCE_Z,
    KINETIC, POTENTIAL, PI, COUNT, TIP = 100, SPEED, TURN, SPIN
};

typedef struct {
    double value[COUNT], t;
    void (*log2)(void *, const char *, Status, const char *, const char *, ...);
    void (*log3)(void *, Status, const char *, const char *);
    void *environment;
} Model;

static const double RAD = 3.14159265358979323846 / 180.0;

static Model *made(void)
{
    Model *m = calloc(1, sizeof *m);
    double *v = m->value;
    v[PHI] = 30.0, v[MASS] = 100.0, v[LENGTH] = 100.0, v[GRAVITY] = 9.81, v[STEP] = 0.01, v[WALL] = -1e9, v[PI] = 3.0;
    return m;
}

static void said(Model *m, const char *text)
{
    if (m->log2) m->log2(m->environment, "one", ERROR, "logStatusError", text);
    if (m->log3) m->log3(m->environment, ERROR, "logStatusError", text);
}

/* All that follows from states and parameters. */
static Status computed(Model *m)
{
    double *v = m->value, mass = 1e-3 * v[MASS], l = 1e-3 * v[LENGTH], phi = RAD * v[PHI], rate = RAD * v[OMEGA];
    double about = 1e-9 * v[INERTIA] + mass * l * l; /* kg m^2 of an inertia in g mm^2 */
    double faster = (-mass * v[GRAVITY] * l * sin(phi) + 1e-3 * v[TORQUE]) / about;
    if (m->t > 0.5 && v[FAULT] == 1.0) *(volatile int *)0 = 1;
    if (m->t > 0.5 && v[FAULT] == 2.0) for (;;) sleep(1);
    if (m->t > 0.5 && v[FAULT] == 3.0) { said(m, "the string is torn"); return ERROR; }
    if (m->t > 0.5 && v[FAULT] == 4.0) faster = NAN;
    v[TOTAL_INERTIA] = 1e9 * about, v[DPHI] = v[OMEGA], v[DOMEGA] = faster / RAD;
    /* On the ground, in mN: the other way round than on the rod. x is along -sin(theta), theta = -phi. */
    double c = cos(phi), s = sin(phi);
    v[FORCE_X] = -1e3 * mass * l * (faster * c - rate * rate * s);
    v[FORCE_Z] = -1e3 * (mass * l * (faster * s + rate * rate * c) + mass * v[GRAVITY]);
    v[KINETIC] = 0.5e3 * about * rate * rate, v[POTENTIAL] = -1e3 * mass * v[GRAVITY] * l * c;
    return OK;
}

/* An array of FMI 3: the mass centre in mm, its velocity in mm/s, the rotation from World to the rod, the rate in rad/s. */
static int array(Model *m, Reference which, double *out)
{
    double *v = m->value, phi = RAD * v[PHI], rate = RAD * v[OMEGA], c = cos(phi), s = sin(phi), l = v[LENGTH];
    double tip[3] = {l * s, 0.0, -l * c}, speed[3] = {l * c * rate, 0.0, l * s * rate}, spin[3] = {0.0, -rate, 0.0};
    double turn[9] = {c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c};
    switch (which) {
    case TIP: memcpy(out, tip, sizeof tip); return 3;
    case SPEED: memcpy(out, speed, sizeof speed); return 3;
    case SPIN: memcpy(out, spin, sizeof spin); return 3;
    case TURN: memcpy(out, turn, sizeof turn); return 9;
    default: *out = v[which]; return 1;
    }
}

static Status stepped(Model *m, double t, double size)
{
    double *v = m->value;
    int count = (int)ceil(size / v[STEP] - 1e-9);
    for (int n = 0; n < (count < 1 ? 1 : count); n++) { /* the classical Runge-Kutta method */
        double h = size / (count < 1 ? 1 : count), x[2] = {v[PHI], v[OMEGA]}, sum[2] = {0.0, 0.0};
        const double at[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};
        double k[2] = {0.0, 0.0};
        for (int i = 0; i < 4; i++) {
            m->t = t + h * (n + at[i]), v[PHI] = x[0] + h * at[i] * k[0], v[OMEGA] = x[1] + h * at[i] * k[1];
            Status status = computed(m);
            if (status != OK) return status;
            k[0] = v[DPHI], k[1] = v[DOMEGA], sum[0] += weight[i] * k[0], sum[1] += weight[i] * k[1];
        }
        v[PHI] = x[0] + h * sum[0] / 6.0, v[OMEGA] = x[1] + h * sum[1] / 6.0;
    }
    m->t = t + size;
    return computed(m);
}

/* At an elastic wall the rate turns round. */
static int bounced(Model *m)
{
    if (m->value[PHI] > m->value[WALL] + 1e-6 || m->value[OMEGA] >= 0.0) return 0;
    m->value[OMEGA] = -m->value[OMEGA];
    return 1;
}

#define M ((Model *)c)
#ifndef FMI3
#define API(name) fmi2##name
typedef int Boolean;
typedef struct {
    void (*log)(void *, const char *, Status, const char *, const char *, ...);
    void *allocate, *release, *finished, *environment;
} Callbacks;
typedef struct {
    Boolean again, ends, nominals, states, has_next;
    double next;
} EventInfo;

const char *fmi2GetTypesPlatform(void) { return "default"; }
Component fmi2Instantiate(const char *name, int kind, const char *guid, const char *place, const Callbacks *callbacks,
                          Boolean visible, Boolean logging)
{
    (void)name, (void)kind, (void)guid, (void)place, (void)visible, (void)logging;
    Model *m = made();
    m->log2 = callbacks->log, m->environment = callbacks->environment;
    return m;
}
Status fmi2SetupExperiment(Component c, Boolean has, double tolerance, double start, Boolean stops, double stop)
{
    (void)has, (void)tolerance, (void)stops, (void)stop;
    M->t = start;
    return OK;
}
Status fmi2EnterInitializationMode(Component c) { return computed(M); }
Status fmi2GetReal(Component c, const Reference *which, size_t count, double *out)
{
    Status status = computed(M);
    for (size_t i = 0; i < count; i++) array(M, which[i], out + i);
    return status;
}
Status fmi2SetReal(Component c, const Reference *which, size_t count, const double *in)
{
    for (size_t i = 0; i < count; i++) M->value[which[i]] = in[i];
    return OK;
}
Status fmi2NewDiscreteStates(Component c, EventInfo *info)
{
    memset(info, 0, sizeof *info);
    info->states = bounced(M);
    return OK;
}
Status fmi2CompletedIntegratorStep(Component c, Boolean kept, Boolean *event, Boolean *ends)
{
    (void)c, (void)kept;
    *event = *ends = 0;
    return OK;
}
Status fmi2GetDerivatives(Component c, double *out, size_t count)
{
    Status status = computed(M);
    memcpy(out, M->value + DPHI, count * sizeof *out);
    return status;
}
Status fmi2DoStep(Component c, double t, double size, Boolean kept) { (void)kept; return stepped(M, t, size); }
#define STUBS(S) S(SetDebugLogging) S(GetInteger) S(GetBoolean) S(GetString) S(SetInteger) S(SetBoolean) S(SetString) \
    S(GetFMUstate) S(SetFMUstate) S(FreeFMUstate) S(SerializedFMUstateSize) S(SerializeFMUstate) S(DeSerializeFMUstate) \
    S(GetDirectionalDerivative) S(SetRealInputDerivatives) S(GetRealOutputDerivatives) S(CancelStep) S(GetStatus) \
    S(GetRealStatus) S(GetIntegerStatus) S(GetBooleanStatus) S(GetStringStatus) S(Reset)
#else
#define API(name) fmi3##name
#include <stdbool.h>
typedef bool Boolean;
static Component instance(void *environment, void (*log)(void *, Status, const char *, const char *))
{
    Model *m = made();
    m->log3 = log, m->environment = environment;
    return m;
}
Component fmi3InstantiateModelExchange(const char *name, const char *token, const char *place, Boolean visible,
                                       Boolean logging, void *environment,
                                       void (*log)(void *, Status, const char *, const char *))
{
    (void)name, (void)token, (void)place, (void)visible, (void)logging;
    return instance(environment, log);
}
Component fmi3InstantiateCoSimulation(const char *name, const char *token, const char *place, Boolean visible,
                                      Boolean logging, Boolean events, Boolean early, const Reference *wanted, size_t count,
                                      void *environment, void (*log)(void *, Status, const char *, const char *),
                                      void *update)
{
    (void)name, (void)token, (void)place, (void)visible, (void)logging, (void)events, (void)early, (void)wanted,
    (void)count, (void)update;
    return instance(environment, log);
}
Status fmi3EnterInitializationMode(Component c, Boolean has, double tolerance, double start, Boolean stops, double stop)
{
    (void)has, (void)tolerance, (void)stops, (void)stop;
    M->t = start;
    return computed(M);
}
Status fmi3GetFloat64(Component c, const Reference *which, size_t count, double *out, size_t values)
{
    (void)values;
    Status status = computed(M);
    for (size_t i = 0; i < count; i++) out += array(M, which[i], out);
    return status;
}
Status fmi3SetFloat64(Component c, const Reference *which, size_t count, const double *in, size_t values)
{
    (void)values;
    for (size_t i = 0; i < count; i++) M->value[which[i]] = in[i];
    return OK;
}
Status fmi3UpdateDiscreteStates(Component c, Boolean *again, Boolean *ends, Boolean *nominals, Boolean *states,
                                Boolean *has_next, double *next)
{
    *again = *ends = *nominals = *has_next = false, *next = 0.0;
    *states = bounced(M);
    return OK;
}
Status fmi3CompletedIntegratorStep(Component c, Boolean kept, Boolean *event, Boolean *ends)
{
    (void)c, (void)kept;
    *event = *ends = false;
    return OK;
}
Status fmi3GetContinuousStateDerivatives(Component c, double *out, size_t count)
{
    Status status = computed(M);
    memcpy(out, M->value + DPHI, count * sizeof *out);
    return status;
}
Status fmi3GetNumberOfEventIndicators(Component c, size_t *count) { (void)c; *count = 1; return OK; }
Status fmi3GetNumberOfContinuousStates(Component c, size_t *count) { (void)c; *count = 2; return OK; }
Status fmi3DoStep(Component c, double t, double size, Boolean kept, Boolean *event, Boolean *ends, Boolean *early,
                  double *last)
{
    (void)kept;
    *event = *ends = *early = false, *last = t + size;
    return stepped(M, t, size);
}
#define STUBS(S) S(SetDebugLogging) S(InstantiateScheduledExecution) S(Reset) S(GetFloat32) S(GetInt8) S(GetUInt8) \
    S(GetInt16) S(GetUInt16) S(GetInt32) S(GetUInt32) S(GetInt64) S(GetUInt64) S(GetBoolean) S(GetString) S(GetBinary) \
    S(GetClock) S(SetFloat32) S(SetInt8) S(SetUInt8) S(SetInt16) S(SetUInt16) S(SetInt32) S(SetUInt32) S(SetInt64) \
    S(SetUInt64) S(SetBoolean) S(SetString) S(SetBinary) S(SetClock) S(GetNumberOfVariableDependencies) \
    S(GetVariableDependencies) S(GetFMUState) S(SetFMUState) S(FreeFMUState) S(SerializedFMUStateSize) \
    S(SerializeFMUState) S(DeserializeFMUState) S(GetDirectionalDerivative) S(GetAdjointDerivative) \
    S(EnterConfigurationMode) S(ExitConfigurationMode) S(GetIntervalDecimal) S(GetIntervalFraction) S(GetShiftDecimal) \
    S(GetShiftFraction) S(SetIntervalDecimal) S(SetIntervalFraction) S(SetShiftDecimal) S(SetShiftFraction) \
    S(EvaluateDiscreteStates) S(EnterStepMode) S(GetOutputDerivatives) S(ActivateModelPartition)
#endif

#define DONE(name) Status name(Component c) { (void)c; return OK; }
#define STUB(name) Status API(name)(void) { return ERROR; }
const char *API(GetVersion)(void) { return "2 or 3"; }
void API(FreeInstance)(Component c) { free(c); }
DONE(API(ExitInitializationMode))
DONE(API(EnterEventMode))
DONE(API(EnterContinuousTimeMode))
DONE(API(Terminate))
Status API(SetTime)(Component c, double t) { M->t = t; return OK; }
Status API(SetContinuousStates)(Component c, const double *x, size_t n) { memcpy(M->value, x, n * sizeof *x); return OK; }
Status API(GetContinuousStates)(Component c, double *x, size_t n) { memcpy(x, M->value, n * sizeof *x); return OK; }
Status API(GetNominalsOfContinuousStates)(Component c, double *x, size_t n)
{
    (void)c;
    for (size_t i = 0; i < n; i++) x[i] = 1.0;
    return OK;
}
Status API(GetEventIndicators)(Component c, double *z, size_t n)
{
    for (size_t i = 0; i < n; i++) z[i] = M->value[PHI] - M->value[WALL];
    return OK;
}
STUBS(STUB)
