/* Counts the instructions of a step on a Cortex-M4F in QEMU, over the readings of the self-test, and the stack of the task that it takes.
 *
 * With `-icount shift=6` every instruction takes 64 ns, and the system timer counts down at 25 MHz. It prints by semihosting; there is no
 * library of C behind it but memcpy, memmove and memset.
 */
#include <stdint.h>
#include "wetclutch_@CAR@.h"

#define TIMER ((volatile uint32_t *)0xe000e010u)
#define COPROCESSORS ((volatile uint32_t *)0xe000ed88u)

wetclutch_estimate wetclutch_@CAR@_estimate;
/* Also enough where the library is linked instead of wetclutch.c. */
static uint64_t memory[1u << 17];
static uint32_t counted, most, learning, init;
static uint64_t sum;
/* A step that takes more learns from a shift. */
#define LEARNING 100000u
/* Below the stack of the caller, words. */
#define PAINTED 32768u
#define PAINT 0x5a5aa5a5u

static int32_t semihosting(int32_t operation, const void *argument) {
  register int32_t r0 __asm__("r0") = operation;
  register const void *r1 __asm__("r1") = argument;
  __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

static void say(const char *text) { (void)semihosting(4, text); }

static void say_number(const char *name, uint32_t number) {
  char digits[12];
  uint32_t at = sizeof digits - 1u;
  digits[at] = '\0';
  do {
    digits[--at] = (char)('0' + number % 10u);
    number /= 10u;
  } while (number != 0u);
  say(name);
  say(" ");
  say(&digits[at]);
  say("\n");
}

/* The self-test calls this instead of wetclutch_step. */
uint32_t __real_wetclutch_step(uint64_t *place, const wetclutch_input *input, wetclutch_estimate *estimate);
uint32_t __wrap_wetclutch_step(uint64_t *place, const wetclutch_input *input, wetclutch_estimate *estimate);
uint32_t __wrap_wetclutch_step(uint64_t *place, const wetclutch_input *input, wetclutch_estimate *estimate) {
  const uint32_t before = TIMER[2];
  const uint32_t status = __real_wetclutch_step(place, input, estimate);
  const uint32_t instructions = ((before - TIMER[2]) & 0xffffffu) * 40u / 64u;
  counted++;
  sum += instructions;
  learning += instructions > LEARNING;
  most = instructions > most ? instructions : most;
  return status;
}

uint32_t __real_wetclutch_init(uint64_t *place, uint32_t bytes, const uint32_t *image, uint32_t image_bytes);
uint32_t __wrap_wetclutch_init(uint64_t *place, uint32_t bytes, const uint32_t *image, uint32_t image_bytes);
uint32_t __wrap_wetclutch_init(uint64_t *place, uint32_t bytes, const uint32_t *image, uint32_t image_bytes) {
  const uint32_t before = TIMER[2];
  const uint32_t status = __real_wetclutch_init(place, bytes, image, image_bytes);
  init = (uint32_t)((uint64_t)((before - TIMER[2]) & 0xffffffu) * 40u / 64u);
  return status;
}

/* Writes the paint below the stack pointer, and finds how deep it has gone. */
static volatile uint32_t *paint(void) {
  volatile uint32_t *const here = (volatile uint32_t *)__builtin_frame_address(0);
  uint32_t at;
  for (at = 64u; at < PAINTED; at++) here[-(int32_t)at] = PAINT;
  return here;
}

static uint32_t stack_of(const volatile uint32_t *here) {
  uint32_t at = PAINTED - 1u;
  while (at > 64u && here[-(int32_t)at] == PAINT) at--;
  return 4u * at;
}

static void run(void) {
  int32_t wrong;
  volatile uint32_t *here;
  TIMER[1] = 0xffffffu;
  TIMER[2] = 0u;
  TIMER[0] = 5u;
  here = paint();
  wrong = wetclutch_@CAR@_selftest(memory, sizeof memory);
  say_number(wrong == 0 ? "self-test 0, steps" : "self-test failed, steps", counted);
  say_number("mean", (uint32_t)(sum / counted));
  say_number("most", most);
  say_number("learning", learning);
  say_number("init", init);
  say_number("stack", stack_of(here));
  (void)semihosting(0x18, (const void *)0x20026);
  for (;;) {
  }
}

extern uint32_t begin_bss[], end_bss[];
void reset(void);
void reset(void) {
  uint32_t *at;
  *COPROCESSORS |= 0xfu << 20;
  __asm__ volatile("dsb\n isb");
  for (at = begin_bss; at < end_bss; at++) *at = 0u;
  run();
}

extern uint32_t stack_top[];
static void fault(void) {
  say("fault\n");
  (void)semihosting(0x18, (const void *)0x20023);
  for (;;) {
  }
}
typedef void (*handler)(void);
__attribute__((section(".vectors"), used)) static const struct {
  uint32_t *stack;
  handler handlers[15];
} vectors = {stack_top, {reset, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault}};
