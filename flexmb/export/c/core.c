/* The functions of MODEL.h around the compiled equations; the tables of the scene stand before this text. */

extern int32_t MODEL_kernel_rates(int64_t *, void **, double, int64_t, int64_t, int64_t, void *, void *);
extern int32_t MODEL_kernel_outputs(int64_t *, void **, double, int64_t, int64_t, void *, void *, void *);
extern int32_t MODEL_kernel_settle(int64_t *, void **, double, int64_t, int64_t, void *);

#if MODEL_DERIVATIVES
extern int32_t MODEL_kernel_derivatives(int64_t *, void **, double, int64_t, int64_t, void *, void *);
extern int32_t MODEL_kernel_outputs_along(int64_t *, void **, double, int64_t, int64_t, void *, void *);
#endif

static unsigned char *memory_of(MODEL_instance *m) {
    return (unsigned char *)(((uintptr_t)m->memory + 63) & ~(uintptr_t)63);
}

static int all_finite(const double *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i])) return 0;
    return 1;
}

void MODEL_init(MODEL_instance *m) {
    unsigned char *memory = memory_of(m);
    memcpy(memory, IMAGE, sizeof IMAGE);
    memset(memory + sizeof IMAGE, 0, MODEL_BYTES - sizeof IMAGE);
    for (size_t i = 0; i < sizeof ADDRESSES / sizeof *ADDRESSES; i++) {
        int64_t address = (int64_t)(uintptr_t)(memory + ADDRESSES[i][1]);
        memcpy(memory + 8 * (size_t)ADDRESSES[i][0], &address, 8);
    }
    memcpy(m->number, MODEL_number_start, MODEL_NUMBERS * sizeof(double));
    m->last = INFINITY;
}

int MODEL_settle(MODEL_instance *m, double t, double *y) {
    int64_t result = 0;
    void *error = NULL;
    if (MODEL_kernel_settle(&result, &error, t, (int64_t)(uintptr_t)y, MODEL_STATES, memory_of(m) + CONSTANTS))
        return -1;
    return (int)result;
}

/* The state before, by which the closures know on which branch they are, is none. */
static void forget(MODEL_instance *m) {
    if (MODEL_REMEMBERED) ((double *)memory_of(m))[BEFORE] = -INFINITY;
}

int MODEL_begin(MODEL_instance *m, double t, double *y) {
    forget(m);
    return MODEL_settle(m, t, y);
}

int MODEL_start(MODEL_instance *m, double t, double *y) {
    memcpy(y, MODEL_state_start, MODEL_STATES * sizeof(double));
    return MODEL_begin(m, t, y);
}

void MODEL_remember(MODEL_instance *m, double *numbers) {
    for (size_t i = 0; i < sizeof KEPT / sizeof *KEPT; numbers += KEPT[i++][1])
        memcpy(numbers, memory_of(m) + 8 * (size_t)KEPT[i][0], 8 * (size_t)KEPT[i][1]);
}

void MODEL_recall(MODEL_instance *m, const double *numbers) {
    for (size_t i = 0; i < sizeof KEPT / sizeof *KEPT; numbers += KEPT[i++][1])
        memcpy(memory_of(m) + 8 * (size_t)KEPT[i][0], numbers, 8 * (size_t)KEPT[i][1]);
}

void MODEL_set(MODEL_instance *m, int number, double value) {
    double *words = (double *)memory_of(m);
    if (m->number[number] == value) return;
    m->number[number] = value;
    if (number >= MODEL_INPUTS) forget(m); /* other masses turn the rows of closures */
    for (int i = TOUCHES[number]; i < TOUCHES[number + 1]; i++) {
        const int word = TOUCHED[i];
        double sum = REST[word];
        for (int k = EFFECTS[word]; k < EFFECTS[word + 1]; k++) sum += SLOPE[k] * m->number[OF_NUMBER[k]];
        words[WORDS[word]] = sum;
    }
}

static int defined(MODEL_instance *m, double *t) {
    if (*t > m->last) *t = m->last;
    return *t >= FROM && *t <= UNTIL;
}

int MODEL_rhs(MODEL_instance *m, double t, const double *y, double *dy) {
    unsigned char *memory = memory_of(m);
    int64_t result = 0;
    void *error = NULL;
    if (!defined(m, &t)) return MODEL_OUT_OF_TIME;
    if (MODEL_kernel_rates(&result, &error, t, (int64_t)(uintptr_t)y, (int64_t)(uintptr_t)dy, MODEL_STATES,
                           memory + CONSTANTS, memory + WORKSPACE))
        return -1;
    return (int)result;
}

int MODEL_outputs(MODEL_instance *m, double t, const double *y, double *dy, double *out) {
    unsigned char *memory = memory_of(m);
    const double *words = (const double *)memory;
    int64_t result = 0;
    void *error = NULL;
    const int status = MODEL_rhs(m, t, y, dy);
    if (status) return status;
    defined(m, &t);
    if (MODEL_kernel_outputs(&result, &error, t, (int64_t)(uintptr_t)y, MODEL_STATES, memory + CONSTANTS,
                             memory + WORKSPACE, memory + OUTPUTS))
        return -1;
    if (result) return (int)result;
    for (int i = 0; i < MODEL_OUTPUTS; i++) {
        const double *energy = words + ENERGY;
        out[i] = PLACE[i] >= 0 ? words[PLACE[i]] : energy[0] + energy[1] + energy[2] + energy[3];
    }
    return 0;
}

#if MODEL_DERIVATIVES
/* J at a state, in the memory of the instance. */
static int differentiate(MODEL_instance *m, double t, const double *y) {
    unsigned char *memory = memory_of(m);
    const double *J = (const double *)memory + JACOBIAN;
    double dy[MODEL_STATES];
    int64_t result = 0;
    void *error = NULL;
    const int status = MODEL_rhs(m, t, y, dy); /* names what a failure is at */
    if (status) return status;
    defined(m, &t);
    if (MODEL_kernel_derivatives(&result, &error, t, (int64_t)(uintptr_t)y, MODEL_STATES, memory + DIFFERENTIATED,
                                 memory + TANGENT))
        return -1;
    if (!result && !all_finite(J, (size_t)MODEL_STATES * MODEL_STATES)) return NONFINITE;
    return (int)result;
}

int MODEL_jacobian(MODEL_instance *m, double t, const double *y, double *J) {
    const int status = differentiate(m, t, y);
    if (!status) memcpy(J, (double *)memory_of(m) + JACOBIAN, sizeof(double) * MODEL_STATES * MODEL_STATES);
    return status;
}

/* Add what the inputs do, on which rates and outputs depend linearly: half the difference for large ones, beside which
 * the rounding of all else is negligible. */
static int add_inputs(MODEL_instance *m, double t, const double *y, const double *input, double *rates, double *outputs) {
    double *words = (double *)memory_of(m), before[INPUT_WORDS + 1], dy[2][MODEL_STATES], out[2][MODEL_OUTPUTS];
    double size = 0.0;
    int status = 0;
    for (int i = 0; i < MODEL_INPUTS; i++) size = fmax(size, fabs(input[i]));
    if (size == 0.0) return 0;
    for (int n = 0; n < INPUT_WORDS; n++) before[n] = words[WORDS[TOUCHED[n]]];
    for (int side = 0; side < 2 && !status; side++) {
        for (int i = 0; i < MODEL_INPUTS; i++)
            for (int n = TOUCHES[i]; n < TOUCHES[i + 1]; n++)
                for (int k = EFFECTS[TOUCHED[n]]; k < EFFECTS[TOUCHED[n] + 1]; k++)
                    if (OF_NUMBER[k] == i) words[WORDS[TOUCHED[n]]] += (side ? -LARGE : LARGE) * SLOPE[k] * (input[i] / size);
        status = outputs ? MODEL_outputs(m, t, y, dy[side], out[side]) : MODEL_rhs(m, t, y, dy[side]);
        for (int n = 0; n < INPUT_WORDS; n++) words[WORDS[TOUCHED[n]]] = before[n];
    }
    if (status) return status;
    for (int i = 0; i < MODEL_STATES; i++) rates[i] += size * ((dy[0][i] - dy[1][i]) / (2.0 * LARGE));
    for (int i = 0; outputs && i < MODEL_OUTPUTS; i++) outputs[i] += size * ((out[0][i] - out[1][i]) / (2.0 * LARGE));
    return 0;
}

int MODEL_along(MODEL_instance *m, double t, const double *y, int fresh, const double *state, const double *input,
                double *rates, double *outputs) {
    unsigned char *memory = memory_of(m);
    double *words = (double *)memory;
    const double *J = words + JACOBIAN;
    int64_t result = 0;
    void *error = NULL;
    int status = fresh ? differentiate(m, t, y) : 0;
    if (status) return status;
    for (int i = 0; i < MODEL_STATES; i++) {
        rates[i] = 0.0;
        for (int k = 0; k < MODEL_STATES; k++) rates[i] += J[(size_t)i * MODEL_STATES + k] * state[k];
    }
    if (outputs) {
        double at = t;
        defined(m, &at);
        memcpy(words + DIRECTION, state, MODEL_STATES * sizeof(double));
        if (MODEL_kernel_outputs_along(&result, &error, at, (int64_t)(uintptr_t)y, MODEL_STATES,
                                       memory + DIFFERENTIATED, memory + TANGENT))
            return -1;
        if (result) return (int)result;
        for (int i = 0; i < MODEL_OUTPUTS; i++) {
            outputs[i] = 0.0;
            if (CHANGE[i] >= 0)
                outputs[i] = words[CHANGE[i]];
            else /* the sum of the energies, whose derivatives have the places of dual numbers */
                for (int k = 0; k < 4; k++) outputs[i] += words[CHANGE[ENERGY_OUTPUT] + DUAL * k];
        }
    }
    return add_inputs(m, t, y, input, rates, outputs);
}
#endif

double MODEL_next_switch(double t) {
    for (int i = 0; i < SWITCHES; i++)
        if (SWITCH[i] > t) return SWITCH[i];
    return INFINITY;
}

void MODEL_segment(MODEL_instance *m, double t) {
    const double next = MODEL_next_switch(t);
    m->last = isinf(next) ? next : nextafter(next, t);
}

/* One step from y to stage[5]. The formulas are those of flexmb's method "rk4". */
static int step_of(MODEL_instance *m, double t, const double *y, double h) {
    double (*k)[MODEL_STATES] = m->stage, *trial = m->stage[4];
    static const double share[4] = {0.0, 0.5, 0.5, 1.0};
    for (int s = 0; s < 4; s++) {
        const double part = share[s] * h;
        for (int i = 0; i < MODEL_STATES; i++) trial[i] = s ? y[i] + part * k[s - 1][i] : y[i];
        int status = MODEL_rhs(m, t + part, trial, k[s]);
        if (status) return status;
    }
    for (int i = 0; i < MODEL_STATES; i++)
        m->stage[5][i] = y[i] + h / 6.0 * (k[0][i] + 2.0 * (k[1][i] + k[2][i]) + k[3][i]);
    return all_finite(m->stage[5], MODEL_STATES) ? 0 : NONFINITE;
}

int MODEL_run(MODEL_instance *m, double t, double t_end, double step, double *y, double *reached) {
    *reached = t;
    while (t < t_end) {
        const double next = MODEL_next_switch(t), end = t_end < next ? t_end : next, start = t;
        const double needed = ceil((end - t) / step * (1.0 - 1e-9)), steps = needed < 1.0 ? 1.0 : needed;
        const double h = (end - start) / steps;
        MODEL_segment(m, start);
        for (double j = 0.0; j < steps; j += 1.0) {
            int status = step_of(m, t, y, h);
            if (status) return status;
            const double reaches = j == steps - 1.0 ? end : start + (j + 1.0) * h;
            status = MODEL_settle(m, reaches, m->stage[5]);
            if (status) return status;
            t = reaches;
            memcpy(y, m->stage[5], MODEL_STATES * sizeof(double));
            *reached = t;
        }
    }
    MODEL_segment(m, t);
    return 0;
}

void MODEL_message(MODEL_instance *m, int status, char *text, size_t size) {
    int64_t fault = 0;
    memcpy(&fault, memory_of(m) + 8 * (size_t)FAULT, 8);
    if (status == MODEL_OUT_OF_TIME) {
        snprintf(text, size, "a table of the scene is defined from %.17g to %.17g s only: stay within", FROM, UNTIL);
        return;
    }
    for (size_t i = 0; i < sizeof ADVICE / sizeof *ADVICE; i++)
        if (ADVICE[i].status == status) {
            const int known = fault >= 0 && fault < ADVICE[i].count;
            snprintf(text, size, ADVICE[i].text, known ? ADVICE[i].names[fault] : "?");
            return;
        }
    snprintf(text, size, status ? "the evaluation failed with status %d" : "done", status);
}
