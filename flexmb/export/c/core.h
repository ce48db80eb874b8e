/* A model that flexmb exported: its equations of motion, without Python and without allocation.
 *
 * A state is a row of MODEL_STATES numbers [coordinates, speeds, work], named in MODEL_state_names, in SI units. Inputs
 * and parameters are MODEL_NUMBERS numbers, inputs first, named in MODEL_number_names; outputs are named in
 * MODEL_output_names. Functions return 0, or a status that MODEL_message explains.
 *
 * An instance must not be moved or copied as memory, because it holds addresses of its own parts. Any number of
 * instances may be used at once, each by one thread at a time. Link with -lm.
 */
#ifndef MODEL_H
#define MODEL_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MODEL_STATES @STATES@
#define MODEL_COORDINATES @COORDINATES@
#define MODEL_INPUTS @INPUTS@
#define MODEL_NUMBERS @NUMBERS@
#define MODEL_OUTPUTS @OUTPUTS@
#define MODEL_BYTES @BYTES@
#define MODEL_REMEMBERED @REMEMBERED@ /* numbers of MODEL_remember, 0 unless the model has closed loops */
#define MODEL_DERIVATIVES @DERIVATIVES@ /* 1 if the model has the functions of derivatives */

#define MODEL_OUT_OF_TIME (-2) /* a table of the scene does not reach there */

typedef struct {
    double number[MODEL_NUMBERS + 1]; /* inputs and parameters; change them by MODEL_set */
    double last; /* s: functions of time are those of the segment that ends here, see MODEL_segment */
    double stage[6][MODEL_STATES]; /* scratch of MODEL_run */
    unsigned char memory[MODEL_BYTES + 64];
} MODEL_instance;

extern const char *const MODEL_state_names[];
extern const char *const MODEL_number_names[];
extern const char *const MODEL_output_names[];
extern const double MODEL_state_start[];
extern const double MODEL_number_start[];

/* Give an instance the numbers of the scene. */
void MODEL_init(MODEL_instance *m);
/* The scene's start at time t: its values, with prescribed motions as they are then and loops closed. */
int MODEL_start(MODEL_instance *m, double t, double *y);
/* The same for a start y of one's own, which receives the nearest one that is possible. Call one of both first. */
int MODEL_begin(MODEL_instance *m, double t, double *y);
/* Change an input or a parameter. */
void MODEL_set(MODEL_instance *m, int number, double value);
/* dy/dt at time t (s). */
int MODEL_rhs(MODEL_instance *m, double t, const double *y, double *dy);
/* The same, and all outputs. */
int MODEL_outputs(MODEL_instance *m, double t, const double *y, double *dy, double *out);
#if MODEL_DERIVATIVES
/* J (MODEL_STATES, MODEL_STATES), row by row: derivatives of dy/dt by y. At a corner of a law those of one side. */
int MODEL_jacobian(MODEL_instance *m, double t, const double *y, double *J);
/* Changes of dy/dt (MODEL_STATES) and, unless `outputs` is NULL, of the outputs, in the direction in which y changes by
 * `state` (MODEL_STATES) and the inputs change by `input` (MODEL_INPUTS). `fresh` is 0 if the derivatives are those at
 * the state, time and numbers of the last call of this function or of MODEL_jacobian. */
int MODEL_along(MODEL_instance *m, double t, const double *y, int fresh, const double *state, const double *input,
                double *rates, double *outputs);
#endif
/* Quaternions get unit length, prescribed motions their values, loops are closed. Of a model with loops call it after
 * each step: it also chooses the rows of the closures for the next one, and steps that turn these too far fail. */
int MODEL_settle(MODEL_instance *m, double t, double *y);
/* What an instance knows of the last step, to go back to it: numbers that a copy of the state needs beside y. */
void MODEL_remember(MODEL_instance *m, double *numbers);
void MODEL_recall(MODEL_instance *m, const double *numbers);
/* The first time after t at which a function of time jumps or is not smooth; infinity if there is none. */
double MODEL_next_switch(double t);
/* Functions of time have their limits from the left at the next switch after t, until this is called again. */
void MODEL_segment(MODEL_instance *m, double t);
/* From t to t_end by the classical Runge-Kutta method, in equal steps of at most `step`, none of which crosses a
 * switch; y is moved on as far as *reached. */
int MODEL_run(MODEL_instance *m, double t, double t_end, double step, double *y, double *reached);
/* What a status means; a text that `text` (size) receives. */
void MODEL_message(MODEL_instance *m, int status, char *text, size_t size);

#ifdef __cplusplus
}
#endif
#endif
