/* Steps the observer over the inputs of a file and writes its estimates. */
#include <stdio.h>
#include "wetclutch_@CAR@.h"

static uint64_t memory[WETCLUTCH_@CAR_UPPER@_MEMORY_BYTES / 8u];

int main(int count, char **names) {
  wetclutch_input input;
  wetclutch_estimate estimate;
  FILE *from = count > 2 ? fopen(names[1], "rb") : NULL, *to = count > 2 ? fopen(names[2], "wb") : NULL;
  if (from == NULL || to == NULL || wetclutch_@CAR@_selftest(memory, sizeof memory) != 0) return 1;
  if (wetclutch_init(memory, sizeof memory, WETCLUTCH_@CAR_UPPER@_IMAGE, WETCLUTCH_@CAR_UPPER@_IMAGE_BYTES) != 0u) return 2;
  while (fread(&input, sizeof input, 1, from) == 1) {
    (void)wetclutch_step(memory, &input, &estimate);
    if (fwrite(&estimate, sizeof estimate, 1, to) != 1) return 3;
  }
  return fclose(to) == 0 ? 0 : 4;
}
