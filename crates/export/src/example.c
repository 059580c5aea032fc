/* The observer in a task of 10 ms, in twenty lines. README.md says how to build it. */
#include <stdio.h>
#include "wetclutch_@CAR@.h"

wetclutch_estimate wetclutch_@CAR@_estimate;
static uint64_t memory[WETCLUTCH_@CAR_UPPER@_MEMORY_BYTES / 8u];

int main(void) {
  wetclutch_input input = {0};
  int32_t wrong = wetclutch_@CAR@_selftest(memory, sizeof memory);
  uint32_t status = wetclutch_init(memory, sizeof memory, WETCLUTCH_@CAR_UPPER@_IMAGE, WETCLUTCH_@CAR_UPPER@_IMAGE_BYTES);
  printf("self-test %d, init 0x%x\n", (int)wrong, (unsigned)status);
  if (wrong != 0 || status != 0u) return 1;
  input.dt_s = 0.01f;
  input.turbine_rad_s = (wetclutch_reading){150.0f, 0.0f, 1u};
  input.output_rad_s = (wetclutch_reading){50.0f, 0.004f, 1u};
  input.gear_from = input.gear_to = 0;
  status = wetclutch_step(memory, &input, &wetclutch_@CAR@_estimate);
  printf("step 0x%x, health %u, pressure of element 0: %.0f Pa\n", (unsigned)status, (unsigned)wetclutch_@CAR@_estimate.health,
         (double)wetclutch_@CAR@_estimate.element_pa[0]);
  return 0;
}
