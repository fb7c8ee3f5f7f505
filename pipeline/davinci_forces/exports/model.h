/*
@HEAD@
 * Every q, dq and ddq is of @COORDINATES@; a joint of a coupled arm needs all of them,
 * low-passed and delayed as below.  The standard deviation leaves out what a filter's delay costs.
@PROCESSING@
 * df_gravity: all that holds a resting arm (weight, springs, offsets).  df_friction: for compensation, the model's minus
 * one standard error, never more than the motion loses.  Both are limited to the largest effort recorded.
 */
#ifndef DAVINCI_FORCES_MODEL_H
#define DAVINCI_FORCES_MODEL_H
#ifdef __cplusplus
extern "C" {
#endif
#ifdef DF_FLOAT
typedef float df_real; /* compiled as C with -DDF_FLOAT: results to four digits */
#else
typedef double df_real;
#endif
enum { DF_COORDINATES = @N@, DF_STATES = @STATES@ };
enum { @JOINTS@, DF_JOINTS };
typedef enum { DF_OK, DF_OUTSIDE_VALIDITY, DF_BAD_INPUT } df_status; /* bad input leaves everything as it was */
typedef struct { int runs; double t; df_real z[DF_STATES], x[9]; } df_state; /* of one joint; begin with zeros */
typedef struct { double t; df_real tau, q_measured, dq_measured, q[DF_COORDINATES], dq[DF_COORDINATES], ddq[DF_COORDINATES]; } df_sample;
typedef struct { df_real tau_hat, tau_ext, std_filter, std; int contact; } df_result; /* contact: -1 where no level is known */
df_status df_inertia(int joint, const df_real *q, df_real *inertia);
df_status df_bias(int joint, const df_state *s, const df_real *q, const df_real *dq, df_real *tau);
df_status df_gravity(int joint, const df_real *q, df_real *tau);
df_status df_friction(int joint, const df_state *s, const df_real *q, const df_real *dq, df_real *tau);
df_status df_effort(int joint, const df_state *s, const df_real *q, const df_real *dq, const df_real *ddq, df_real *tau);
df_status df_step(int joint, df_state *s, const df_sample *sample, df_result *result); /* a gap restarts the filter */
#ifdef __cplusplus
}
#endif
#endif
