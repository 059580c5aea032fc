/* A stand-in for the header of Simulink: what the S-function calls, for one block. */
#ifndef SIMSTRUC_H
#define SIMSTRUC_H
#include <stddef.h>

typedef double real_T;
typedef int int_T;
typedef struct { real_T value; } mxArray;
typedef struct {
  int_T parameters, inputs, outputs, input_widths[8], output_widths[8], feed_through[8], contiguous[8], works, work_width;
  real_T sample_time_s;
  mxArray parameter;
  real_T input[8][64], output[8][64], *work;
  const char *error;
} SimStruct;

#define SS_DOUBLE 0
#define ssSetNumSFcnParams(S, count) ((S)->parameters = (count))
#define ssGetNumSFcnParams(S) ((S)->parameters)
#define ssGetSFcnParamsCount(S) ((void)(S), 1)
#define ssSetSFcnParamTunable(S, index, is_tunable) ((void)(S))
#define ssGetSFcnParam(S, index) (&(S)->parameter)
#define mxGetScalar(of) ((of)->value)
#define ssSetNumInputPorts(S, count) ((S)->inputs = (count))
#define ssSetNumOutputPorts(S, count) ((S)->outputs = (count))
#define ssSetInputPortWidth(S, port, width) ((S)->input_widths[port] = (width))
#define ssSetOutputPortWidth(S, port, width) ((S)->output_widths[port] = (width))
#define ssSetInputPortDirectFeedThrough(S, port, has) ((S)->feed_through[port] = (has))
#define ssSetInputPortRequiredContiguous(S, port, is) ((S)->contiguous[port] = (is))
#define ssSetNumSampleTimes(S, count) ((void)(S))
#define ssSetSampleTime(S, index, time_s) ((S)->sample_time_s = (time_s))
#define ssSetOffsetTime(S, index, time_s) ((void)(S))
#define ssSetNumDWork(S, count) ((S)->works = (count))
#define ssSetDWorkWidth(S, index, width) ((S)->work_width = (width))
#define ssSetDWorkDataType(S, index, type) ((void)(S))
#define ssGetDWork(S, index) ((void *)(S)->work)
#define ssGetInputPortRealSignal(S, port) ((const real_T *)(S)->input[port])
#define ssGetOutputPortRealSignal(S, port) ((S)->output[port])
#define ssSetErrorStatus(S, message) ((S)->error = (message))
#endif
