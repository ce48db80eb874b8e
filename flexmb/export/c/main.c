/* An example: the scene from its start for one second, with its state at the end; "time" measures an evaluation. */
#include "MODEL.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

int main(int count, char **words) {
    MODEL_instance *m = malloc(sizeof *m);
    double y[MODEL_STATES], dy[MODEL_STATES], out[MODEL_OUTPUTS], t = 0.0, end = count > 1 ? atof(words[1]) : 1.0;
    const double step = count > 2 ? atof(words[2]) : 1e-4;
    char text[400];
    MODEL_init(m);
    int status = MODEL_start(m, 0.0, y);
    if (count > 3 && !strcmp(words[3], "time")) {
        const clock_t begun = clock();
        for (int i = 0; i < 20000; i++) {
            y[0] += 1e-9;
            MODEL_rhs(m, 0.1, y, dy);
        }
        printf("%.1f ns\n", (double)(clock() - begun) * 1e9 / CLOCKS_PER_SEC / 20000.0);
        return 0;
    }
    if (!status) status = MODEL_run(m, 0.0, end, step, y, &t);
    if (!status) status = MODEL_outputs(m, t, y, dy, out);
    if (status) {
        MODEL_message(m, status, text, sizeof text);
        fprintf(stderr, "t = %g s: %s\n", t, text);
        return 1;
    }
    for (int i = 0; i < MODEL_STATES; i++) printf("%s %.17g\n", MODEL_state_names[i], y[i]);
    for (int i = 0; i < MODEL_OUTPUTS; i++) printf("%s %.17g\n", MODEL_output_names[i], out[i]);
    free(m);
    return 0;
}
