/* MODEL in a page of the web: one instance, whose state and outputs the page reads where `states` and `outputs` say. */
#define OFFERED(name) __attribute__((export_name(#name))) name

static MODEL_instance instance;
static double state[MODEL_STATES + 1], rate[MODEL_STATES + 1], output[MODEL_OUTPUTS + 1], now;
static char text[600];

void OFFERED(initialise)(void) { MODEL_init(&instance); }
void OFFERED(change)(int number, double value) { MODEL_set(&instance, number, value); }
int OFFERED(begin)(double t) {
    now = t;
    return MODEL_start(&instance, t, state);
}
int OFFERED(advance)(double until, double step) { return MODEL_run(&instance, now, until, step, state, &now); }
int OFFERED(observe)(void) { return MODEL_outputs(&instance, now, state, rate, output); }
double OFFERED(reached)(void) { return now; }
const double *OFFERED(states)(void) { return state; }
const double *OFFERED(outputs)(void) { return output; }
const char *OFFERED(explain)(int status) {
    MODEL_message(&instance, status, text, sizeof text);
    return text;
}
