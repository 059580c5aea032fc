/* Calls every function rightly and wrongly, and prints what each returns. */
#include <stdio.h>
#include <string.h>
#include "wetclutch_@CAR@.h"

#define IMAGE WETCLUTCH_@CAR_UPPER@_IMAGE
#define IMAGE_BYTES WETCLUTCH_@CAR_UPPER@_IMAGE_BYTES

static uint64_t memory[WETCLUTCH_@CAR_UPPER@_MEMORY_BYTES / 8u];
static uint64_t moved[WETCLUTCH_@CAR_UPPER@_MEMORY_BYTES / 8u + 1u];
static uint32_t image[IMAGE_BYTES / 4u];
static wetclutch_learnt learnt;
static wetclutch_learnt others;

static void say(const char *what, uint32_t status) {
  printf("%s 0x%x\n", what, (unsigned)status);
}

static void init_with(const char *what, uint32_t bytes) {
  say(what, wetclutch_init(memory, sizeof memory, image, bytes));
}

static uint32_t sum_of(const void *of, size_t bytes) {
  const unsigned char *at = of;
  uint32_t sum = 0u;
  while (bytes-- > 0u) sum = sum * 31u + *at++;
  return sum;
}

static void run(const char *what, uint64_t *place, uint32_t steps) {
  wetclutch_estimate estimate;
  wetclutch_input input;
  uint32_t step, sum = 0u, status = 0u;
  memset(&input, 0, sizeof input);
  for (step = 0u; step < steps; step++) {
    const float t = 0.01f * (float)step;
    input.dt_s = step == 20u ? 0.0f : 0.01f;
    input.turbine_rad_s = (wetclutch_reading){150.0f + 10.0f * t, 0.0f, 1u};
    input.output_rad_s = (wetclutch_reading){50.0f, step == 30u ? -1.0f : 0.004f, 1u};
    input.engine_rad_s = (wetclutch_reading){170.0f, 0.0f, step % 2u};
    input.commands[0] = (wetclutch_reading){0.4f + t, 0.0f, 1u};
    input.gear_to = step < 40u ? 0 : 1;
    input.gear_from = step < 60u ? 0 : 1;
    if (step == 50u) input.gear_to = 99;
    status |= wetclutch_step(place, &input, &estimate);
    sum = sum * 31u + sum_of(&estimate, sizeof estimate);
  }
  printf("%s 0x%x, estimates %08x\n", what, (unsigned)status, (unsigned)sum);
}

int main(void) {
  wetclutch_estimate estimate;
  wetclutch_input input;
  const uint32_t needed = wetclutch_memory_size(IMAGE, IMAGE_BYTES);
  memset(&input, 0, sizeof input);
  memcpy(image, IMAGE, sizeof image);
  say("memory is enough", needed <= sizeof memory && needed > 0u);
  say("memory of no image", wetclutch_memory_size(NULL, IMAGE_BYTES));
  say("memory of a short image", wetclutch_memory_size(image, IMAGE_BYTES - 4u));
  say("step before init", wetclutch_step(memory, &input, &estimate));
  printf("gears %d %d, phase %d\n", (int)estimate.gear_from, (int)estimate.gear_to, (int)estimate.phase);
  say("reset before init", wetclutch_reset(memory));
  say("learnt before init", wetclutch_learnt_get(memory, &learnt));
  say("set before init", wetclutch_learnt_set(memory, &learnt));
  say("init in no memory", wetclutch_init(NULL, sizeof memory, image, IMAGE_BYTES));
  say("init off by four bytes", wetclutch_init((uint64_t *)(void *)((char *)memory + 4), 64u, image, IMAGE_BYTES));
  say("init in little memory", wetclutch_init(memory, needed - 8u, image, IMAGE_BYTES));
  say("init in four bytes", wetclutch_init(memory, 4u, image, IMAGE_BYTES));
  say("init of no image", wetclutch_init(memory, sizeof memory, NULL, IMAGE_BYTES));
  say("init of an image off by two bytes", wetclutch_init(memory, sizeof memory, (const uint32_t *)(const void *)((const char *)image + 2), 64u));
  init_with("init of a short image", IMAGE_BYTES - 4u);
  init_with("init of seven bytes", 7u);
  init_with("init of nothing", 0u);
  image[40] ^= 1u;
  init_with("init of a changed image", IMAGE_BYTES);
  say("its memory", wetclutch_memory_size(image, IMAGE_BYTES));
  image[40] ^= 1u;
  image[1] += 1u;
  init_with("init of another version", IMAGE_BYTES);
  image[1] -= 1u;
  image[0] += 1u;
  init_with("init of no image at all", IMAGE_BYTES);
  image[0] -= 1u;
  image[4] = 99u;
  say("seal", wetclutch_seal(image, IMAGE_BYTES));
  init_with("init with 99 elements", IMAGE_BYTES);
  memcpy(image, IMAGE, sizeof image);
  image[17] = 0x7fc00000u;
  say("seal", wetclutch_seal(image, IMAGE_BYTES));
  init_with("init with a value that is no number", IMAGE_BYTES);
  say("step after it", wetclutch_step(memory, &input, &estimate));
  say("seal of nothing", wetclutch_seal(NULL, IMAGE_BYTES));
  say("seal of seven bytes", wetclutch_seal(image, 7u));
  memcpy(image, IMAGE, sizeof image);
  image[2] = 0u;
  image[3] = 0u;
  say("seal", wetclutch_seal(image, IMAGE_BYTES));
  say("is the one of the file", (uint32_t)(memcmp(image, IMAGE, sizeof image) == 0));
  init_with("init", IMAGE_BYTES);
  say("step into nothing", wetclutch_step(memory, &input, NULL));
  say("step of nothing", wetclutch_step(memory, NULL, &estimate));
  run("run", memory, 120u);
  say("learnt into nothing", wetclutch_learnt_get(memory, NULL));
  say("learnt", wetclutch_learnt_get(memory, &learnt));
  say("set nothing", wetclutch_learnt_set(memory, NULL));
  others = learnt;
  others.words[5] ^= 0x10u;
  say("set what is damaged", wetclutch_learnt_set(memory, &others));
  run("run on", memory, 50u);
  say("set", wetclutch_learnt_set(memory, &learnt));
  run("run anew", memory, 50u);
  say("reset", wetclutch_reset(memory));
  memcpy(moved, memory, sizeof memory);
  run("run after a reset", memory, 50u);
  run("the same, moved", moved, 50u);
  say("learnt", wetclutch_learnt_get(memory, &learnt));
  printf("learnt %08x\n", (unsigned)sum_of(&learnt, sizeof learnt));
  return 0;
}
