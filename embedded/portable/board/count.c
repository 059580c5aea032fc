/* Counts the instructions of a step on a Cortex-M4F in QEMU, over the readings of the self-test, after the self-test itself.
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
static uint32_t counted, most;
static uint64_t sum;

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
  most = instructions > most ? instructions : most;
  return status;
}

static void run(void) {
  int32_t wrong;
  TIMER[1] = 0xffffffu;
  TIMER[2] = 0u;
  TIMER[0] = 5u;
  wrong = wetclutch_@CAR@_selftest(memory, sizeof memory);
  say_number(wrong == 0 ? "self-test 0, steps" : "self-test failed, steps", counted);
  say_number("mean", (uint32_t)(sum / counted));
  say_number("most", most);
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
