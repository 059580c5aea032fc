#include <float.h>
#include <math.h>
#include <string.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ != 0))
#error "compile without -ffast-math and -ffinite-math-only: they change floating-point operations"
#endif
#if defined(FLT_EVAL_METHOD) && (FLT_EVAL_METHOD != 0)
#error "float must be evaluated as float (FLT_EVAL_METHOD 0)"
#endif
/* No operation is combined with another one. GCC does not know this: -std=c99 or -ffp-contract=off there. */
#if defined(__clang__) || !defined(__GNUC__)
#pragma STDC FP_CONTRACT OFF
#endif

/* The byte order of the machine: the memory is an array of words of 32 bits in this order. */
#if !defined(WETCLUTCH_BIG_ENDIAN)
#if defined(__BYTE_ORDER__) && defined(__ORDER_BIG_ENDIAN__) && defined(__ORDER_LITTLE_ENDIAN__)
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
#define WETCLUTCH_BIG_ENDIAN 1
#elif __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define WETCLUTCH_BIG_ENDIAN 0
#endif
#elif defined(_M_IX86) || defined(_M_X64) || defined(_M_ARM64) || defined(__LITTLE_ENDIAN__)
#define WETCLUTCH_BIG_ENDIAN 0
#elif defined(__BIG_ENDIAN__)
#define WETCLUTCH_BIG_ENDIAN 1
#endif
#endif
#if !defined(WETCLUTCH_BIG_ENDIAN)
#error "define WETCLUTCH_BIG_ENDIAN as 1 if the highest byte of a word comes first on this machine, else as 0"
#endif
#if WETCLUTCH_BIG_ENDIAN
#define OF_BYTE 3u
#else
#define OF_BYTE 0u
#endif

/* A word of the memory, whatever type the caller gives it. */
#if defined(__GNUC__)
typedef union __attribute__((may_alias)) {
  uint32_t u;
  float f;
} word_t;
#else
typedef union {
  uint32_t u;
  float f;
} word_t;
#endif

#if defined(__GNUC__)
#define SMALL static inline __attribute__((unused))
#else
#define SMALL static inline
#endif

/* The word at an address and an offset of the memory. */
SMALL word_t *word_at(uint8_t *m, uint32_t address, uint32_t offset)
{
  return (word_t *)(void *)(m + address + offset);
}

/* What stands at an address and an offset. Words are at multiples of four. */
SMALL uint32_t u32_at(uint8_t *m, uint32_t address, uint32_t offset)
{
  return word_at(m, address, offset)->u;
}

SMALL float f32_at(uint8_t *m, uint32_t address, uint32_t offset)
{
  return word_at(m, address, offset)->f;
}

SMALL uint64_t u64_at(uint8_t *m, uint32_t address, uint32_t offset)
{
  return (uint64_t)u32_at(m, address, offset) | ((uint64_t)u32_at(m, address, offset + 4u) << 32);
}

SMALL uint32_t u8_at(const uint8_t *m, uint32_t address, uint32_t offset)
{
  return m[((size_t)address + offset) ^ OF_BYTE];
}

SMALL uint32_t u16_at(const uint8_t *m, uint32_t address, uint32_t offset)
{
  return u8_at(m, address, offset) | (u8_at(m, address, offset + 1u) << 8);
}

SMALL void set_u32(uint8_t *m, uint32_t address, uint32_t offset, uint32_t value)
{
  word_at(m, address, offset)->u = value;
}

SMALL void set_f32(uint8_t *m, uint32_t address, uint32_t offset, float value)
{
  word_at(m, address, offset)->f = value;
}

SMALL void set_u64(uint8_t *m, uint32_t address, uint32_t offset, uint64_t value)
{
  set_u32(m, address, offset, (uint32_t)value);
  set_u32(m, address, offset + 4u, (uint32_t)(value >> 32));
}

SMALL void set_u8(uint8_t *m, uint32_t address, uint32_t offset, uint32_t value)
{
  m[((size_t)address + offset) ^ OF_BYTE] = (uint8_t)(value & 0xffu);
}

SMALL void set_u16(uint8_t *m, uint32_t address, uint32_t offset, uint32_t value)
{
  set_u8(m, address, offset, value);
  set_u8(m, address, offset + 1u, value >> 8);
}

SMALL uint32_t bits(float value)
{
  word_t word;
  word.f = value;
  return word.u;
}

SMALL float single(uint32_t value)
{
  word_t word;
  word.u = value;
  return word.f;
}

/* The square root of the processor, where it is known to have a correctly rounded one. */
#if defined(__GNUC__) && defined(__arm__) && defined(__ARM_FP)
#if (__ARM_FP & 4) != 0
#define SQUARE_ROOT 1
SMALL float square_root(float value)
{
  float root;
  __asm__("vsqrt.f32 %0, %1" : "=t"(root) : "t"(value));
  return root;
}
#endif
#elif defined(__GNUC__) && defined(__SSE2__)
#define SQUARE_ROOT 1
SMALL float square_root(float value)
{
  float root;
  __asm__("sqrtss %1, %0" : "=x"(root) : "x"(value));
  return root;
}
#endif

/* Words at addresses that are no multiple of four. */
SMALL uint32_t u32_of_bytes(const uint8_t *m, uint32_t address, uint32_t offset)
{
  return u16_at(m, address, offset) | (u16_at(m, address, offset + 2u) << 16);
}

SMALL float f32_of_bytes(const uint8_t *m, uint32_t address, uint32_t offset)
{
  return single(u32_of_bytes(m, address, offset));
}

SMALL uint64_t u64_of_bytes(const uint8_t *m, uint32_t address, uint32_t offset)
{
  return (uint64_t)u32_of_bytes(m, address, offset) | ((uint64_t)u32_of_bytes(m, address, offset + 4u) << 32);
}

SMALL void set_bytes_of_u32(uint8_t *m, uint32_t address, uint32_t offset, uint32_t value)
{
  set_u16(m, address, offset, value);
  set_u16(m, address, offset + 2u, value >> 16);
}

SMALL void set_bytes_of_f32(uint8_t *m, uint32_t address, uint32_t offset, float value)
{
  set_bytes_of_u32(m, address, offset, bits(value));
}

SMALL void set_bytes_of_u64(uint8_t *m, uint32_t address, uint32_t offset, uint64_t value)
{
  set_bytes_of_u32(m, address, offset, (uint32_t)value);
  set_bytes_of_u32(m, address, offset + 4u, (uint32_t)(value >> 32));
}

/* Copies bytes; the places may overlap. */
SMALL void copy(uint8_t *m, uint32_t to, uint32_t from, uint32_t count)
{
#if WETCLUTCH_BIG_ENDIAN
  uint32_t i;
  if (((to | from | count) & 3u) != 0u) {
    if (to <= from) {
      for (i = 0u; i < count; i++) {
        set_u8(m, to, i, u8_at(m, from, i));
      }
    } else {
      for (i = count; i > 0u; i--) {
        set_u8(m, to, i - 1u, u8_at(m, from, i - 1u));
      }
    }
    return;
  }
#endif
  (void)memmove(m + to, m + from, (size_t)count);
}

/* Writes a byte to so many places. */
SMALL void fill(uint8_t *m, uint32_t to, uint32_t value, uint32_t count)
{
#if WETCLUTCH_BIG_ENDIAN
  uint32_t i;
  if (((to | count) & 3u) != 0u) {
    for (i = 0u; i < count; i++) {
      set_u8(m, to, i, value);
    }
    return;
  }
#endif
  (void)memset(m + to, (int)(value & 0xffu), (size_t)count);
}

/* The whole part of a number within the range of the type; 0 of what is no number. */
SMALL uint32_t whole(float value)
{
  if (!(value > 0.0f)) {
    return 0u;
  }
  return (value >= 0x1p+32f) ? 0xffffffffu : (uint32_t)value;
}

SMALL uint32_t whole_signed(float value)
{
  if (value != value) {
    return 0u;
  }
  if (value >= 0x1p+31f) {
    return 0x7fffffffu;
  }
  return (value < -0x1p+31f) ? 0x80000000u : (uint32_t)(int32_t)value;
}

/* The smaller and the larger one; not a number if one of them is not; -0 is smaller than 0. */
SMALL float smaller(float a, float b)
{
  if ((a != a) || (b != b)) {
    return a + b;
  }
  if (a == b) {
    return single(bits(a) | bits(b));
  }
  return (a < b) ? a : b;
}

SMALL float larger(float a, float b)
{
  if ((a != a) || (b != b)) {
    return a + b;
  }
  if (a == b) {
    return single(bits(a) & bits(b));
  }
  return (a > b) ? a : b;
}

/* A shift of a signed number to the right. */
SMALL uint32_t shift_signed(uint32_t value, uint32_t by)
{
  const uint32_t sign = ((value >> 31) != 0u) ? 0xffffffffu : 0u;
  const uint32_t count = by & 31u;
  return (value >> count) | ((count == 0u) ? 0u : (sign << (32u - count)));
}

SMALL uint32_t rotate(uint32_t value, uint32_t by)
{
  const uint32_t count = by & 31u;
  return (count == 0u) ? value : ((value << count) | (value >> (32u - count)));
}

SMALL uint32_t leading_zeros(uint32_t value)
{
  uint32_t count = 0u;
  while ((count < 32u) && ((value & (0x80000000u >> count)) == 0u)) {
    count++;
  }
  return count;
}

SMALL uint32_t extend_8(uint32_t value)
{
  return ((value & 0x80u) != 0u) ? (value | 0xffffff00u) : (value & 0xffu);
}
