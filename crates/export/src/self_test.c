/* Self-test of the observer: a simulated shift @SHIFT@, and the estimates for it to the last bit.
 *
 * Another result means that compiler or linker have changed the arithmetic: fused or reordered operations, another rounding, numbers below
 * the normal ones set to zero. It runs on the controller as on a PC.
 */
#include <string.h>
#include "wetclutch_@CAR@.h"

#define R(value, age_s) {value, age_s, 1u}
#define NONE {0.0f, 0.0f, 0u}

/* What is read in each step. */
static const wetclutch_input inputs[] = {
@INPUTS@};

/* @NAMES@ in each step. */
static const float expected[][@COMPARED@] = {
@EXPECTED@};

/* CRC-32 of all words of all estimates. */
#define ESTIMATES_CHECKSUM @CHECKSUM@u

static uint32_t crc32_of(uint32_t crc, const void *bytes, uint32_t count) {
  const unsigned char *at = bytes;
  uint32_t byte, bit;
  for (byte = 0u; byte < count; byte += 4u) {
    uint32_t word;
    memcpy(&word, at + byte, 4u);
    for (bit = 0u; bit < 32u; bit++) {
      const uint32_t odd = (crc ^ (word >> bit)) & 1u;
      crc = (crc >> 1) ^ (odd != 0u ? 0xedb88320u : 0u);
    }
  }
  return crc;
}

int32_t wetclutch_@CAR@_selftest(uint64_t *memory, uint32_t memory_bytes) {
  const uint32_t steps = (uint32_t)(sizeof inputs / sizeof inputs[0]);
  uint32_t crc = 0xffffffffu, step;
  if (wetclutch_init(memory, memory_bytes, WETCLUTCH_@CAR_UPPER@_IMAGE, WETCLUTCH_@CAR_UPPER@_IMAGE_BYTES) != 0u) {
    return -1;
  }
  for (step = 0u; step < steps; step++) {
    wetclutch_estimate estimate;
    float got[@COMPARED@];
    (void)wetclutch_step(memory, &inputs[step], &estimate);
@MEMBERS@    if (memcmp(got, expected[step], sizeof got) != 0) {
      return (int32_t)step + 1;
    }
    crc = crc32_of(crc, &estimate, (uint32_t)sizeof estimate);
  }
  return (crc ^ 0xffffffffu) == ESTIMATES_CHECKSUM ? 0 : -2;
}
