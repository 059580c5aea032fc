/* Runs the S-function over the inputs of a file, and a step beside it; prints how many steps differ. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wetclutch_@CAR@_sfunction.c"

static SimStruct block;
static uint64_t beside[WETCLUTCH_@CAR_UPPER@_MEMORY_BYTES / 8u];

static real_T port_of(const wetclutch_reading *reading) { return reading->came != 0u ? (real_T)reading->value : (real_T)NAN; }

static int is_same(real_T a, float b, uint32_t is_given) { return is_given != 0u ? a == (real_T)b : a != a; }

int main(int count, char **names) {
  FILE *from = count > 1 ? fopen(names[1], "rb") : NULL;
  wetclutch_input input;
  int steps = 0, given = 0, ranges = 0, different = 0, at;
  if (from == NULL) return 1;
  block.parameter.value = 0.5;
  mdlInitializeSizes(&block);
  if (block.error == NULL) return 2;
  block.error = NULL;
  block.parameter.value = (real_T)0.01f;
  mdlInitializeSizes(&block);
  mdlInitializeSampleTimes(&block);
  block.work = calloc((size_t)block.work_width, sizeof(real_T));
  mdlInitializeConditions(&block);
  for (at = 0; at < READINGS; at++) {
    block.input[0][at] = at % 2 == 0 ? 1e300 : (real_T)NAN;
    block.input[1][at] = -1e300;
  }
  for (at = 0; at < 3; at++) block.input[3][at] = at == 0 ? 1e12 : (real_T)NAN;
  mdlOutputs(&block, 0);
  at = WETCLUTCH_STATUS_GEAR_REFUSED | WETCLUTCH_STATUS_READING_REFUSED;
  if (((int)block.output[2][0] & at) != at || block.output[0][0] == block.output[0][0]) return 6;
  mdlInitializeConditions(&block);
  if (block.error != NULL || block.sample_time_s != block.parameter.value || block.inputs != 4 || block.outputs != 4) return 3;
  if (wetclutch_init(beside, sizeof beside, WETCLUTCH_@CAR_UPPER@_IMAGE, WETCLUTCH_@CAR_UPPER@_IMAGE_BYTES) != 0u) return 4;
  while (fread(&input, sizeof input, 1, from) == 1) {
    const wetclutch_reading *const channels[READINGS] = {&input.engine_rad_s, &input.turbine_rad_s, &input.output_rad_s, &input.wheel_rad_s, &input.engine_n_m, &input.acceleration_m_s2, &input.oil_degc};
    wetclutch_estimate estimate;
    uint32_t has_clutch;
    input.dt_s = 0.01f;
    for (at = 0; at < READINGS; at++) {
      block.input[0][at] = port_of(channels[at]);
      block.input[1][at] = (real_T)channels[at]->age_s;
    }
    for (at = 0; at < ELEMENTS; at++) {
      input.commands[at].age_s = 0.0f;
      block.input[2][at] = port_of(&input.commands[at]);
    }
    block.input[3][0] = (real_T)input.gear_from;
    block.input[3][1] = (real_T)input.gear_to;
    block.input[3][2] = (real_T)input.lock_up_applied;
    mdlOutputs(&block, 0);
    (void)wetclutch_step(beside, &input, &estimate);
    has_clutch = estimate.given & WETCLUTCH_GIVEN_CLUTCHES;
    steps++;
    given += has_clutch != 0u;
    ranges += has_clutch != 0u && block.output[1][5] == (real_T)estimate.oncoming.pressure_range_pa[1];
    different += !is_same(block.output[0][0], estimate.offgoing.pressure_pa, has_clutch) || !is_same(block.output[0][3], estimate.oncoming.torque_n_m, has_clutch) ||
                 !is_same(block.output[0][5], estimate.shaft_n_m, estimate.given & WETCLUTCH_GIVEN_SHAFT) || block.output[2][0] != (real_T)estimate.status ||
                 block.output[2][1] != (real_T)estimate.health || block.output[2][2] != (real_T)estimate.phase || block.output[3][1] != (real_T)estimate.element_pa[1];
  }
  mdlTerminate(&block);
  printf("%d steps, %d with clutches, %d with a range, %d different\n", steps, given, ranges, different);
  return fclose(from) == 0 ? 0 : 5;
}
