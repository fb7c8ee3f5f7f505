/*
@HEAD@
 * df_step takes samples at DF_RATE, @HZ@ Hz.  A single gap restarts the filter.  Samples at another rate, by 2 % on
 * average or gap after gap, give DF_OTHER_RATE with NaN: resample them, or identify from logs at their rate.
 * Every q, dq and ddq is of @COORDINATES@; a joint of a coupled arm needs all of them,
 * each filtered and delayed by the cutoff and the lag of the joint that is computed.
 * What a sample holds, for each joint with its own cutoff and lag, which are below:
 *   q            position after the low-pass
 *   dq           central difference of q, or the measured velocity after the same low-pass; 0 where its sign is
 *                unknown (in logs: the column dq of the record JointModel)
 *   ddq          central difference of dq, before that
 *   q_measured   position without low-pass
 *   dq_measured  measured velocity without low-pass; if only positions are measured, the central difference of the
 *                position after a low-pass at @LOWPASS@ Hz
 *   tau          effort, less what is there without contact, as the offset of a day
 * In a log, the low-pass is a Butterworth filter of order 4, run forwards and backwards: no delay, half the amplitude at
 * the cutoff, none of it if the cutoff is at least 0.4 DF_RATE.  The effort lags the motion, so all but tau are delayed by
 * the lag, or advanced by its size if it is negative; tau stays where it is.
 * In a controller, low-pass by a filter without later samples, which delays q by some D.  Delay q_measured and
 * dq_measured by D, too, and tau by D minus the lag: tau is then late by the size of a negative lag, which is the same
 * as all else being early.  The standard deviation and the alarm level leave out what such a delay costs, so free motion
 * can exceed the level often.  Take the largest |tau_ext| of free motion in your controller as the level instead.
 * In a log, dq is 0 where the velocity after a low-pass at @LOWPASS@ Hz, not delayed by the lag, is below 0.6745 standard
 * deviations of its noise.  At standstill it is 0 up to 6 of them, or up to L / (1 s) if that is more.  Standstill is each
 * second in which the position after that low-pass moves by less than L, and 1 / (@LOWPASS@ Hz) before and after it.  L is
 * 1 % of rms(dq) (1 s), or 6 standard deviations of that position's noise if they are more, but at most 5 % of it.
 * In a controller, set dq to 0 where that velocity at the time of q, or else dq itself, is below the one stated here, the
 * median of the logs.  A sample with dq in place of 0, or 0 in place of dq, changes tau_hat by about the Coulomb friction.
 * Of each joint:
@PROCESSING@
 * df_gravity: all that holds a resting arm (weight, springs, offsets).  df_friction: for compensation, the model's minus
 * one standard error, never more than the motion loses.  Its memory of a displacement advances in df_step alone.  Both
 * are limited to the largest effort recorded.  A joint that does not exist is bad input.
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
#define DF_RATE @RATE@ /* [Hz] */
#define DF_PERIOD @PERIOD@ /* [s] */
enum { DF_COORDINATES = @N@, DF_STATES = @STATES@ };
enum { @JOINTS@, DF_JOINTS };
typedef enum { DF_OK, DF_OUTSIDE_VALIDITY, DF_BAD_INPUT, DF_OTHER_RATE } df_status; /* bad input leaves everything as it was */
typedef struct { int runs; double t, pace; df_real late, z[DF_STATES], x[9]; } df_state; /* of one joint; begin with zeros */
typedef struct { double t; df_real tau, q_measured, dq_measured, q[DF_COORDINATES], dq[DF_COORDINATES], ddq[DF_COORDINATES]; } df_sample;
/* tau_hat: the model's effort.  tau_ext = tau - tau_hat, filtered: what the arm exerts on its environment.  std: its
 * deviation, in total, with the filter's lag.  contact: 1 above the alarm level; -1 without one, and for the first second. */
typedef struct { df_real tau_hat, tau_ext, std_filter, std; int contact; } df_result;
df_status df_inertia(int joint, const df_real *q, df_real *inertia);
df_status df_bias(int joint, const df_state *s, const df_real *q, const df_real *dq, df_real *tau);
df_status df_gravity(int joint, const df_real *q, df_real *tau);
df_status df_friction(int joint, const df_state *s, const df_real *q, const df_real *dq, df_real *tau);
df_status df_effort(int joint, const df_state *s, const df_real *q, const df_real *dq, const df_real *ddq, df_real *tau);
df_status df_step(int joint, df_state *s, const df_sample *sample, df_result *result);
#ifdef __cplusplus
}
#endif
#endif
