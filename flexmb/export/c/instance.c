/* An instance of MODEL.h as a simulation tool uses it: its phases, values, derivatives, events and steps. This is what
 * FMI 2.0 and 3.0 have in common; before it stand `Host`, what a tool gives to an instance, and `tell`, `reserve` and
 * `release`, which use it. Both versions number their statuses alike. */

#define API __attribute__((visibility("default")))
#define N MODEL_STATES
enum { STATE = 0, RATE = N, NUMBER = 2 * N, OUTPUT = 2 * N + MODEL_NUMBERS, STEP_SIZE = OUTPUT + MODEL_OUTPUTS };
enum { TIME = STEP_SIZE + 1 };
enum { INSTANTIATED = 1, INITIALISING = 2, EVENTS = 4, CONTINUOUS = 8, STEPPING = 16, FAILED = 32, ENDED = 64 };
enum { STALE, RATES_KNOWN, ALL_KNOWN };
enum { DONE = 0, DISCARDED = 2, REFUSED = 3 };

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
    int known, differentiated, is_cs;
    double reached;
    Host host;
    char name[128];
} Instance;

static int fail(Instance *c, const char *text) {
    tell(&c->host, c->name, text);
    return REFUSED;
}

static int failed(Instance *c, int status) {
    char text[600];
    MODEL_message(&c->model, status, text, sizeof text);
    return fail(c, text);
}

static int out_of_order(Instance *c, const char *function) {
    char text[200];
    snprintf(text, sizeof text, "%s is not allowed now: see the calling sequences of FMI", function);
    return fail(c, text);
}

#define IN(phases) \
    Instance *c = component; \
    if (!c) return REFUSED; \
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

static Instance *created(const Host *host, const char *name, const char *guid, int is_cs) {
    const char *wrong = NULL;
    if (!guid || strcmp(guid, MODEL_GUID))
        wrong = "the library and modelDescription.xml are of different models: the archive is damaged, or was put "
                "together from others; export the scene again";
    else if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") || !__builtin_cpu_supports("bmi2"))
        wrong = "this processor lacks AVX2 or fused multiply-add, for which the model is compiled (x86-64-v3)";
    else if (is_cs && !(STEP > 0.0))
        wrong = "this model was exported for Model Exchange only: export it with --step for Co-Simulation";
    if (wrong) {
        tell(host, name, wrong);
        return NULL;
    }
    Instance *c = reserve(host, sizeof(Instance));
    if (!c) return NULL;
    begin(c);
    c->host = *host;
    c->is_cs = is_cs;
    snprintf(c->name, sizeof c->name, "%s", name ? name : "");
    return c;
}

static int set_up(Instance *c, int has_tolerance, double tolerance, double start) {
    if (!isfinite(start)) return fail(c, "the start time is not finite");
    if (has_tolerance && tolerance > 0.0) c->v.tolerance = tolerance;
    c->v.t = start;
    return DONE;
}

/* Prescribed motions have their values, quaternions unit length, and loops are closed, from the start on. */
static int settle(Instance *c) {
    MODEL_segment(&c->model, c->v.t);
    c->v.last = c->model.last;
    const int status = MODEL_begin(&c->model, c->v.t, c->v.y);
    stale(c);
    return status ? failed(c, status) : DONE;
}

static int initialised(Instance *c) {
    if (settle(c) != DONE) return REFUSED;
    c->v.started = 1;
    c->v.set = 0;
    c->v.phase = c->is_cs ? STEPPING : EVENTS;
    return DONE;
}

/* Failures that a shorter step of the importer may avoid: of states too far from the last step's, and overflow. */
static int shorter(Instance *c, int status) {
    const int far = MODEL_REMEMBERED && (status == SINGULAR || status == BRANCH);
    return c->v.phase == CONTINUOUS && (far || status == NONFINITE) ? DISCARDED : REFUSED;
}

static int know(Instance *c, int what) {
    if (c->known >= what) return DONE;
    int status = what == ALL_KNOWN ? MODEL_outputs(&c->model, c->v.t, c->v.y, c->dy, c->out)
                                   : MODEL_rhs(&c->model, c->v.t, c->v.y, c->dy);
    if (!status && (!all_finite(c->dy, N) || (what == ALL_KNOWN && !all_finite(c->out, MODEL_OUTPUTS)))) status = NONFINITE;
    if (status) {
        failed(c, status);
        return shorter(c, status);
    }
    c->known = what;
    return DONE;
}

static int get(Instance *c, const unsigned int *vr, size_t count, double *value) {
    for (size_t i = 0; i < count; i++) {
        const unsigned int r = vr[i];
        int status = DONE;
        if (c->v.phase == INITIALISING && (r < NUMBER || (r >= OUTPUT && r < STEP_SIZE))) {
            const int known = c->known;
            if (settle(c) != DONE) return REFUSED;
            c->known = known;
        }
        if (r < RATE)
            value[i] = c->v.y[r];
        else if (r < NUMBER) {
            if ((status = know(c, RATES_KNOWN)) != DONE) return status;
            value[i] = c->dy[r - RATE];
        } else if (r < OUTPUT)
            value[i] = c->v.number[r - NUMBER];
        else if (r < STEP_SIZE) {
            if ((status = know(c, ALL_KNOWN)) != DONE) return status;
            value[i] = c->out[r - OUTPUT];
        } else if (r == STEP_SIZE && STEP > 0.0)
            value[i] = c->v.step;
        else if (r == TIME)
            value[i] = c->v.t;
        else
            return fail(c, "there is no real variable of this value reference");
    }
    return DONE;
}

static int set(Instance *c, const unsigned int *vr, size_t count, const double *value) {
    for (size_t i = 0; i < count; i++) {
        const unsigned int r = vr[i];
        if (!isfinite(value[i])) return fail(c, "a value that is set is not finite");
        if (r < RATE) {
            if (c->v.started && !c->is_cs) return fail(c, "states are set by SetContinuousStates after the start");
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
    return DONE;
}

static int none(Instance *c, size_t count) { return count ? fail(c, "this model has real variables only") : DONE; }

/* Saved states */

static int save(Instance *c, void **state) {
    if (!*state) *state = reserve(&c->host, sizeof(Values));
    if (!*state) return fail(c, "there is no memory for the state");
    MODEL_remember(&c->model, c->v.remembered);
    memcpy(*state, &c->v, sizeof(Values));
    return DONE;
}

static int restore(Instance *c, const void *state) {
    if (!state) return fail(c, "there is no state to be set");
    memcpy(&c->v, state, sizeof(Values));
    for (int i = 0; i < MODEL_NUMBERS; i++) MODEL_set(&c->model, i, c->v.number[i]);
    MODEL_recall(&c->model, c->v.remembered);
    c->model.last = c->v.last;
    stale(c);
    return DONE;
}

static int forget_saved(Instance *c, void **state) {
    if (*state) release(&c->host, *state);
    *state = NULL;
    return DONE;
}

static int write_saved(Instance *c, const void *state, void *bytes, size_t size) {
    if (!state || size < sizeof(Values)) return fail(c, "the place for the state is too small");
    memcpy(bytes, state, sizeof(Values));
    return DONE;
}

static int read_saved(Instance *c, const void *bytes, size_t size, void **state) {
    uint64_t guid = 0;
    memcpy(&guid, MODEL_GUID, sizeof guid);
    if (size != sizeof(Values) || memcmp(bytes, &guid, sizeof guid)) return fail(c, "this is a state of another model");
    if (!*state) *state = reserve(&c->host, sizeof(Values));
    if (!*state) return fail(c, "there is no memory for the state");
    memcpy(*state, bytes, sizeof(Values));
    return DONE;
}

/* Derivatives of unknowns z along changes dv of v. */
#if MODEL_DERIVATIVES
static double *known_at(Instance *c, unsigned int r, double *state, double *input) {
    if (r < RATE) return state + r;
    if (r >= NUMBER && r < NUMBER + MODEL_INPUTS) return input + (r - NUMBER);
    char text[300];
    const char *name = r >= NUMBER && r < OUTPUT ? MODEL_number_names[r - NUMBER] : "this variable";
    snprintf(text, sizeof text, "derivatives are by states and inputs, not by %s", name);
    fail(c, text);
    return NULL;
}

static int along(Instance *c, const unsigned int *z, size_t nz, const unsigned int *v, size_t nv, const double *dv,
                 double *dz) {
    double state[N] = {0.0}, input[MODEL_INPUTS + 1] = {0.0}, rates[N], out[MODEL_OUTPUTS];
    int seen = 0;
    if (!all_finite(dv, nv)) return fail(c, "a direction is not finite");
    for (size_t i = 0; i < nv; i++) {
        double *place = known_at(c, v[i], state, input);
        if (!place) return REFUSED;
        *place += dv[i];
    }
    for (size_t i = 0; i < nz; i++) {
        if (z[i] >= STEP_SIZE || (z[i] >= NUMBER && z[i] < OUTPUT))
            return fail(c, "derivatives are of states, their rates and outputs, not of inputs and parameters");
        seen |= z[i] >= OUTPUT;
    }
    if (c->v.phase == INITIALISING && settle(c) != DONE) return REFUSED;
    const int status = MODEL_along(&c->model, c->v.t, c->v.y, !c->differentiated, state, input, rates, seen ? out : NULL);
    c->differentiated = !status;
    if (status) {
        failed(c, status);
        return shorter(c, status);
    }
    for (size_t i = 0; i < nz; i++)
        dz[i] = z[i] < RATE ? state[z[i]] : z[i] < NUMBER ? rates[z[i] - RATE] : out[z[i] - OUTPUT];
    return DONE;
}
#else
static int along(Instance *c, const unsigned int *z, size_t nz, const unsigned int *v, size_t nv, const double *dv,
                 double *dz) {
    (void)z, (void)nz, (void)v, (void)nv, (void)dv, (void)dz;
    return fail(c, "this model provides no directional derivatives: export it with --derivatives");
}
#endif

/* Model Exchange */

/* New discrete states: functions of time have their limits from the right, and loops that have drifted are closed. */
static int updated(Instance *c, int *moved, double *next) {
    *moved = 0;
    *next = MODEL_next_switch(c->v.t);
    MODEL_segment(&c->model, c->v.t);
    c->v.last = c->model.last;
    stale(c);
    if (c->v.drifted) {
        const int status = MODEL_settle(&c->model, c->v.t, c->v.y);
        if (status) return failed(c, status);
        c->v.drifted = 0;
        *moved = 1;
    }
    return DONE;
}

static int completed(Instance *c, int *asks) {
    *asks = 0;
    if (!MODEL_REMEMBERED) return DONE;
    double closed[N];
    memcpy(closed, c->v.y, sizeof closed);
    const int status = MODEL_settle(&c->model, c->v.t, closed);
    if (status) return failed(c, status);
    for (int i = 0; i < N; i++)
        if (fabs(closed[i] - c->v.y[i]) > c->v.tolerance * fmax(1.0, fabs(closed[i]))) c->v.drifted = *asks = 1;
    stale(c);
    return DONE;
}

static int set_time(Instance *c, double t) {
    if (!isfinite(t)) return fail(c, "a time that is set is not finite");
    if (t != c->v.t) stale(c);
    c->v.t = t;
    return DONE;
}

static int set_states(Instance *c, const double *y, size_t count) {
    if (count != N) return fail(c, "the number of states is another one");
    if (!all_finite(y, N)) {
        fail(c, "a state that is set is not finite");
        return shorter(c, NONFINITE);
    }
    memcpy(c->v.y, y, sizeof c->v.y);
    stale(c);
    return DONE;
}

static int get_rates(Instance *c, double *dy, size_t count) {
    if (count != N) return fail(c, "the number of states is another one");
    const int status = know(c, RATES_KNOWN);
    if (status == DONE) memcpy(dy, c->dy, sizeof c->dy);
    return status;
}

static int get_states(Instance *c, double *y, size_t count) {
    if (count != N) return fail(c, "the number of states is another one");
    memcpy(y, c->v.y, sizeof c->v.y);
    return DONE;
}

static int nominals(Instance *c, double *nominal, size_t count) {
    if (count != N) return fail(c, "the number of states is another one");
    for (size_t i = 0; i < count; i++) nominal[i] = 1.0;
    return DONE;
}

static int indicators(Instance *c, size_t count) {
    return count ? fail(c, "this model has no event indicators") : DONE;
}

/* Co-Simulation */

static int step(Instance *c, double t, double size) {
    if (!(size > 0.0) || !isfinite(size) || !isfinite(t)) return fail(c, "a communication step is positive and finite");
    c->v.t = t;
    int status = c->v.set && MODEL_REMEMBERED ? MODEL_begin(&c->model, t, c->v.y) : 0;
    c->v.set = 0;
    if (!status) status = MODEL_run(&c->model, t, t + size, c->v.step, c->v.y, &c->v.t);
    c->v.last = c->model.last;
    c->reached = c->v.t;
    stale(c);
    if (!status) return DONE;
    c->v.phase = FAILED;
    return failed(c, status);
}
