
/* The memory behind the constants: what is passed, then the observer, then the image or what was learnt. The first word is SEAL when there is
 * an observer of this build, the second one the address behind it. */
#define SEAL (0x43434c57u ^ MODULE_HASH)
#define AT_INPUT HEAP
#define AT_ESTIMATE (AT_INPUT + (uint32_t)sizeof(wetclutch_input))
#define AT_OBSERVER ((AT_ESTIMATE + (uint32_t)sizeof(wetclutch_estimate) + 7u) & ~7u)

/* Places of words in an image. */
#define HEADER_BYTES 60u
#define SIZE_AT 2u
#define CHECKSUM_AT 3u

struct long_alignment {
  char c;
  uint64_t value;
};

static int is_usable(const void *pointer, size_t alignment)
{
  return (pointer != NULL) && (((uintptr_t)pointer & (alignment - 1u)) == 0u);
}

static int is_memory(const uint64_t *memory)
{
  return is_usable(memory, offsetof(struct long_alignment, value));
}

/* The checksum of an image: CRC-32 of all words but that of the checksum itself. */
static uint32_t checksum_of(const uint32_t *image, uint32_t words)
{
  uint32_t crc = 0xffffffffu;
  uint32_t at;
  for (at = 0u; at < words; at++) {
    if (at != CHECKSUM_AT) {
      uint32_t bit;
      uint32_t word;
      (void)memcpy(&word, &image[at], sizeof word);
      crc ^= word;
      for (bit = 0u; bit < 32u; bit++) {
        crc = (crc >> 1) ^ (((crc & 1u) != 0u) ? 0xedb88320u : 0u);
      }
    }
  }
  return crc ^ 0xffffffffu;
}

/* A status, or 0 and the memory of the observer alone in bytes. */
static uint32_t check_image(const uint32_t *image, uint32_t image_bytes, uint32_t *observer_bytes)
{
  uint64_t checked;
  uint32_t is_right;
  *observer_bytes = 0u;
  if (!is_usable(image, sizeof(uint32_t))) {
    return WETCLUTCH_STATUS_BAD_POINTER;
  }
  if (((image_bytes & 3u) != 0u) || (image_bytes < HEADER_BYTES)) {
    return WETCLUTCH_STATUS_IMAGE_SIZE;
  }
  is_right = (checksum_of(image, image_bytes / 4u) == image[CHECKSUM_AT]) ? 1u : 0u;
  checked = inner_wetclutch_check(image[0], image[1], image[SIZE_AT], is_right, image[4], image[5], image[6], image_bytes);
  *observer_bytes = (uint32_t)checked;
  return (uint32_t)(checked >> 32);
}

/* Memory in all, bytes. */
static uint32_t bytes_of(uint32_t observer_bytes, uint32_t image_bytes)
{
  const uint32_t learnt = (uint32_t)sizeof(wetclutch_learnt);
  const uint32_t end = AT_OBSERVER + observer_bytes + ((image_bytes > learnt) ? image_bytes : learnt);
  return (end + 7u) & ~7u;
}

uint32_t wetclutch_memory_size(const uint32_t *image, uint32_t image_bytes)
{
  uint32_t observer_bytes;
  const uint32_t status = check_image(image, image_bytes, &observer_bytes);
  return (status == 0u) ? bytes_of(observer_bytes, image_bytes) : 0u;
}

uint32_t wetclutch_init(uint64_t *memory, uint32_t memory_bytes, const uint32_t *image, uint32_t image_bytes)
{
  uint8_t *const m = (uint8_t *)memory;
  uint32_t observer_bytes;
  uint32_t status;
  if (!is_memory(memory)) {
    return WETCLUTCH_STATUS_BAD_POINTER;
  }
  if (memory_bytes < 8u) {
    return WETCLUTCH_STATUS_MEMORY_SIZE;
  }
  set_u32(m, 0u, 0u, 0u);
  status = check_image(image, image_bytes, &observer_bytes);
  if (status != 0u) {
    return status;
  }
  if (memory_bytes < bytes_of(observer_bytes, image_bytes)) {
    return WETCLUTCH_STATUS_MEMORY_SIZE;
  }
  begin_memory(m);
  (void)memcpy(m + AT_OBSERVER + observer_bytes, image, (size_t)image_bytes);
  status = inner_wetclutch_init(m, STACK_BYTES, AT_OBSERVER, observer_bytes, AT_OBSERVER + observer_bytes, image_bytes);
  if (status == 0u) {
    set_u32(m, 0u, 4u, AT_OBSERVER + observer_bytes);
    set_u32(m, 0u, 0u, SEAL);
  }
  return status;
}

/* 0 if there is an observer in the memory. */
static uint32_t status_of(const uint64_t *memory)
{
  const uint8_t *const m = (const uint8_t *)memory;
  uint32_t seal;
  if (!is_memory(memory)) {
    return WETCLUTCH_STATUS_BAD_POINTER;
  }
  (void)memcpy(&seal, m, sizeof seal);
  return (seal == SEAL) ? 0u : WETCLUTCH_STATUS_NOT_INITIALISED;
}

uint32_t wetclutch_step(uint64_t *memory, const wetclutch_input *input, wetclutch_estimate *estimate)
{
  uint8_t *const m = (uint8_t *)memory;
  uint32_t at_input = 0u;
  uint32_t status;
  if (!is_usable(estimate, sizeof(uint32_t))) {
    return WETCLUTCH_STATUS_BAD_POINTER;
  }
  status = status_of(memory);
  if (status != 0u) {
    (void)memset(estimate, 0, sizeof *estimate);
    estimate->status = status;
    estimate->gear_from = -1;
    estimate->gear_to = -1;
    estimate->phase = -1;
    return status;
  }
  if (is_usable(input, sizeof(uint32_t)) != 0) {
    at_input = AT_INPUT;
    (void)memcpy(m + AT_INPUT, input, sizeof *input);
  }
  status = inner_wetclutch_step(m, STACK_BYTES, AT_OBSERVER, at_input, AT_ESTIMATE);
  (void)memcpy(estimate, m + AT_ESTIMATE, sizeof *estimate);
  return status;
}

uint32_t wetclutch_reset(uint64_t *memory)
{
  const uint32_t status = status_of(memory);
  return (status == 0u) ? inner_wetclutch_reset((uint8_t *)memory, STACK_BYTES, AT_OBSERVER) : status;
}

/* The same, or that what is passed is no place for words. */
static uint32_t status_with(const uint64_t *memory, const void *passed)
{
  return is_usable(passed, sizeof(uint32_t)) ? status_of(memory) : WETCLUTCH_STATUS_BAD_POINTER;
}

uint32_t wetclutch_learnt_get(uint64_t *memory, wetclutch_learnt *learnt)
{
  uint8_t *const m = (uint8_t *)memory;
  uint32_t status = status_with(memory, learnt);
  if (status == 0u) {
    const uint32_t at = u32_at(m, 0u, 4u);
    status = inner_wetclutch_learnt_get(m, STACK_BYTES, AT_OBSERVER, at);
    if (status == 0u) {
      (void)memcpy(learnt, m + at, sizeof *learnt);
    }
  }
  return status;
}

uint32_t wetclutch_learnt_set(uint64_t *memory, const wetclutch_learnt *learnt)
{
  uint8_t *const m = (uint8_t *)memory;
  uint32_t status = status_with(memory, learnt);
  if (status == 0u) {
    const uint32_t at = u32_at(m, 0u, 4u);
    (void)memcpy(m + at, learnt, sizeof *learnt);
    status = inner_wetclutch_learnt_set(m, STACK_BYTES, AT_OBSERVER, at);
  }
  return status;
}

uint32_t wetclutch_seal(uint32_t *image, uint32_t image_bytes)
{
  if (!is_usable(image, sizeof(uint32_t))) {
    return WETCLUTCH_STATUS_BAD_POINTER;
  }
  if (((image_bytes & 3u) != 0u) || (image_bytes < 4u * (CHECKSUM_AT + 1u))) {
    return WETCLUTCH_STATUS_IMAGE_SIZE;
  }
  image[SIZE_AT] = image_bytes;
  image[CHECKSUM_AT] = checksum_of(image, image_bytes / 4u);
  return 0u;
}

/* The end of wetclutch.c. */
