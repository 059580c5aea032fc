/* The observer as a block of Simulink: a C MEX S-function of level 2. README.md says how it is built.
 *
 * Parameter: the sample time, s.
 *
 * | input | width | what it is |
 * |---|---|---|
 * | 1 | 7 | engine, turbine, output and wheel speed, rad/s; engine torque, N m; longitudinal acceleration, m/s^2; oil temperature, degC. Not a number (NaN) where no reading came |
 * | 2 | 7 | the age of each, s |
 * | 3 | @ELEMENTS@ | commands of the valves, A or %, by the places of the elements, as they are now; NaN where none came |
 * | 4 | 3 | places of the gear before and after, -1 neutral; 1 while the lock-up clutch carries torque |
 *
 * | output | width | what it is |
 * |---|---|---|
 * | 1 | 6 | offgoing and oncoming clutch: pressure, Pa, and torque, N m, of each; torque at the gearbox input and of the drive shafts, N m. NaN where the estimate does not give it |
 * | 2 | 8 | lowest and highest pressure, Pa, and torque, N m, of the offgoing, then of the oncoming clutch; NaN without a range |
 * | 3 | 3 | status, health, phase of the shift (-1 none), as in wetclutch.h |
 * | 4 | @ELEMENTS@ | pressure of each element by the models of its valve and piston, Pa |
 *
 * The estimate of a step is that of its inputs, and each step changes the state: the block may not stand in an algebraic loop.
 */
#define S_FUNCTION_NAME wetclutch_@CAR@_sfunction
#define S_FUNCTION_LEVEL 2

#include <float.h>
#include <math.h>

#include "simstruc.h"
#include "wetclutch_@CAR@.h"

#define READINGS 7
#define ELEMENTS @ELEMENTS@
#define TORQUES 6
#define RANGES 8
#define WORDS 3
/* The memory of the observer: a work vector, so that Simulink saves and restores it with its own state. */
#define MEMORY_WORDS ((int_T)((WETCLUTCH_@CAR_UPPER@_MEMORY_BYTES + 7u) / 8u))

#define MDL_CHECK_PARAMETERS
static void mdlCheckParameters(SimStruct *S)
{
  const real_T step_s = mxGetScalar(ssGetSFcnParam(S, 0));
  if (!((step_s > 0.0) && (step_s <= 0.1))) {
    ssSetErrorStatus(S, "the sample time must be above 0 and at most 0.1 s");
  }
}

static void mdlInitializeSizes(SimStruct *S)
{
  static const int_T inputs[4] = {READINGS, READINGS, ELEMENTS, 3};
  static const int_T outputs[4] = {TORQUES, RANGES, WORDS, ELEMENTS};
  int_T port;
  ssSetNumSFcnParams(S, 1);
  if (ssGetNumSFcnParams(S) != ssGetSFcnParamsCount(S)) {
    return; /* Simulink says so */
  }
  /* It is called where a parameter changes, not for the first one. */
  mdlCheckParameters(S);
  ssSetSFcnParamTunable(S, 0, 0);
  if (!ssSetNumInputPorts(S, 4) || !ssSetNumOutputPorts(S, 4)) {
    return;
  }
  for (port = 0; port < 4; port++) {
    ssSetInputPortWidth(S, port, inputs[port]);
    ssSetInputPortDirectFeedThrough(S, port, 1);
    ssSetInputPortRequiredContiguous(S, port, 1);
    ssSetOutputPortWidth(S, port, outputs[port]);
  }
  ssSetNumSampleTimes(S, 1);
  ssSetNumDWork(S, 1);
  ssSetDWorkWidth(S, 0, MEMORY_WORDS);
  ssSetDWorkDataType(S, 0, SS_DOUBLE);
}

static void mdlInitializeSampleTimes(SimStruct *S)
{
  ssSetSampleTime(S, 0, mxGetScalar(ssGetSFcnParam(S, 0)));
  ssSetOffsetTime(S, 0, 0.0);
}

/* At the start, and where a subsystem resets its states. */
#define MDL_INITIALIZE_CONDITIONS
static void mdlInitializeConditions(SimStruct *S)
{
  const uint32_t status = wetclutch_init((uint64_t *)ssGetDWork(S, 0), (uint32_t)MEMORY_WORDS * 8u, WETCLUTCH_@CAR_UPPER@_IMAGE, WETCLUTCH_@CAR_UPPER@_IMAGE_BYTES);
  if (status != 0u) {
    ssSetErrorStatus(S, "wetclutch_init refuses the parameters; files of one export belong together");
  }
}

/* In single precision; what is too large there is infinite, and refused. */
static float single_of(real_T value)
{
  return (fabs(value) <= (real_T)FLT_MAX) ? (float)value : ((value > 0.0) ? INFINITY : -INFINITY);
}

static wetclutch_reading reading_of(real_T value, real_T age_s)
{
  wetclutch_reading reading = {0.0f, 0.0f, 0u};
  if (value == value) {
    reading.value = single_of(value);
    reading.age_s = (age_s == age_s) ? single_of(age_s) : 0.0f;
    reading.came = 1u;
  }
  return reading;
}

/* A place of a gear; what can be none is one that is in no table. */
static int32_t gear_of(real_T value)
{
  return ((value >= -1.0) && (value <= 1000.0)) ? (int32_t)value : 1000;
}

static real_T if_given(float value, uint32_t is_given)
{
  return (is_given != 0u) ? (real_T)value : (real_T)NAN;
}

static void mdlOutputs(SimStruct *S, int_T tid)
{
  const real_T *const readings = ssGetInputPortRealSignal(S, 0);
  const real_T *const ages_s = ssGetInputPortRealSignal(S, 1);
  const real_T *const commands = ssGetInputPortRealSignal(S, 2);
  const real_T *const gears = ssGetInputPortRealSignal(S, 3);
  real_T *const torques = ssGetOutputPortRealSignal(S, 0);
  real_T *const ranges = ssGetOutputPortRealSignal(S, 1);
  real_T *const words = ssGetOutputPortRealSignal(S, 2);
  real_T *const elements = ssGetOutputPortRealSignal(S, 3);
  wetclutch_input input = {0};
  wetclutch_estimate estimate;
  wetclutch_reading *const channels[READINGS] = {&input.engine_rad_s, &input.turbine_rad_s, &input.output_rad_s, &input.wheel_rad_s, &input.engine_n_m, &input.acceleration_m_s2, &input.oil_degc};
  const wetclutch_clutch *const clutches[2] = {&estimate.offgoing, &estimate.oncoming};
  int_T at;
  (void)tid;
  input.dt_s = (float)mxGetScalar(ssGetSFcnParam(S, 0));
  for (at = 0; at < READINGS; at++) {
    *channels[at] = reading_of(readings[at], ages_s[at]);
  }
  for (at = 0; at < ELEMENTS; at++) {
    input.commands[at] = reading_of(commands[at], 0.0);
  }
  input.gear_from = gear_of(gears[0]);
  input.gear_to = gear_of(gears[1]);
  input.lock_up_applied = (gears[2] > 0.5) ? 1u : 0u;
  (void)wetclutch_step((uint64_t *)ssGetDWork(S, 0), &input, &estimate);
  for (at = 0; at < 2; at++) {
    const wetclutch_clutch *const clutch = clutches[at];
    const uint32_t has_clutch = estimate.given & WETCLUTCH_GIVEN_CLUTCHES;
    const uint32_t has_range = (has_clutch != 0u) ? (clutch->flags & WETCLUTCH_CLUTCH_RANGE) : 0u;
    torques[2 * at] = if_given(clutch->pressure_pa, has_clutch);
    torques[2 * at + 1] = if_given(clutch->torque_n_m, has_clutch);
    ranges[4 * at] = if_given(clutch->pressure_range_pa[0], has_range);
    ranges[4 * at + 1] = if_given(clutch->pressure_range_pa[1], has_range);
    ranges[4 * at + 2] = if_given(clutch->torque_range_n_m[0], has_range);
    ranges[4 * at + 3] = if_given(clutch->torque_range_n_m[1], has_range);
  }
  torques[4] = if_given(estimate.turbine_n_m, estimate.given & WETCLUTCH_GIVEN_TURBINE);
  torques[5] = if_given(estimate.shaft_n_m, estimate.given & WETCLUTCH_GIVEN_SHAFT);
  words[0] = (real_T)estimate.status;
  words[1] = (real_T)estimate.health;
  words[2] = (real_T)estimate.phase;
  for (at = 0; at < ELEMENTS; at++) {
    elements[at] = (real_T)estimate.element_pa[at];
  }
}

static void mdlTerminate(SimStruct *S)
{
  (void)S;
}

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
