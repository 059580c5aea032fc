/* Steps the observer over the inputs of a file by the functions of FMI 2.0 and 3.0, and writes the words of its estimates.
   fmu LIBRARY RESOURCES TOKEN INPUTS ESTIMATES2 ESTIMATES3; prints what goes wrong. */
#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { INPUTS = 1000, ESTIMATES = 2000, INPUT_WORDS = @INPUT_WORDS@, ESTIMATE_WORDS = @ESTIMATE_WORDS@ };
static const char input_kinds[] = "@INPUT_KINDS@", estimate_kinds[] = "@ESTIMATE_KINDS@";
typedef struct {
  void (*logger)(void *, const char *, int, const char *, const char *, ...);
  void *memory[2], *step_finished, *environment;
} callbacks;
static void *library, *(*instantiate2)(const char *, int, const char *, const char *, const callbacks *, int, int);
static void *(*instantiate3)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t, void *,
                             void (*)(void *, int, const char *, const char *), void *);
static int messages;

static void said2(void *environment, const char *name, int status, const char *category, const char *message, ...) {
  messages += environment == &messages && strcmp(name, "car") == 0 && status == 3 && category != NULL && strlen(message) > 10;
}
static void said3(void *environment, int status, const char *category, const char *message) {
  messages += environment == &messages && status == 3 && category != NULL && strlen(message) > 10;
}
static void *of(int version, const char *name) {
  char whole[64];
  void *found;
  snprintf(whole, sizeof whole, "fmi%d%s", version, name);
  if ((found = dlsym(library, whole)) == NULL) printf("no %s\n", whole), exit(1);
  return found;
}
#define MUST(condition) \
  if (!(condition)) printf("fmi%d, line %d: %s\n", version, __LINE__, #condition), exit(1)
#define REFUSED(call) messages = 0; MUST((call) == 3 && messages == 1)

static int get_real(int version, void *it, uint32_t reference, double *value) {
  if (version == 2) return ((int (*)(void *, const uint32_t *, size_t, double *))of(2, "GetReal"))(it, &reference, 1, value);
  return ((int (*)(void *, const uint32_t *, size_t, double *, size_t))of(3, "GetFloat64"))(it, &reference, 1, value, 1);
}
static int set_real(int version, void *it, uint32_t reference, double value) {
  if (version == 2) return ((int (*)(void *, const uint32_t *, size_t, double *))of(2, "SetReal"))(it, &reference, 1, &value);
  return ((int (*)(void *, const uint32_t *, size_t, double *, size_t))of(3, "SetFloat64"))(it, &reference, 1, &value, 1);
}
static int get_whole(int version, void *it, uint32_t reference, int32_t *value) {
  if (version == 2) return ((int (*)(void *, const uint32_t *, size_t, int32_t *))of(2, "GetInteger"))(it, &reference, 1, value);
  return ((int (*)(void *, const uint32_t *, size_t, int32_t *, size_t))of(3, "GetInt32"))(it, &reference, 1, value, 1);
}
static int set_whole(int version, void *it, uint32_t reference, int32_t value) {
  if (version == 2) return ((int (*)(void *, const uint32_t *, size_t, int32_t *))of(2, "SetInteger"))(it, &reference, 1, &value);
  return ((int (*)(void *, const uint32_t *, size_t, int32_t *, size_t))of(3, "SetInt32"))(it, &reference, 1, &value, 1);
}
static int simple(int version, void *it, const char *name) { return ((int (*)(void *))of(version, name))(it); }
static int begin(int version, void *it, double start_s) {
  if (version == 3) return ((int (*)(void *, bool, double, double, bool, double))of(3, "EnterInitializationMode"))(it, false, 0, start_s, false, 0);
  int status = ((int (*)(void *, int, double, double, int, double))of(2, "SetupExperiment"))(it, 0, 0, start_s, 0, 0);
  return status != 0 ? status : simple(2, it, "EnterInitializationMode");
}
static int step(int version, void *it, double time_s, double length_s) {
  bool flags[3] = {true, true, true};
  double last_s;
  int status;
  if (version == 2) return ((int (*)(void *, double, double, int))of(2, "DoStep"))(it, time_s, length_s, 1);
  status = ((int (*)(void *, double, double, bool, bool *, bool *, bool *, double *))of(3, "DoStep"))(it, time_s, length_s, true, flags, flags + 1, flags + 2, &last_s);
  if (flags[0] || flags[1] || flags[2] || (status == 0 && last_s != time_s + length_s)) printf("results of a step\n"), exit(1);
  return status;
}
static void *instantiate(int version, const char *folder, const char *token) {
  static const callbacks to_us = {said2, {NULL, NULL}, NULL, &messages};
  char location[4096];
  if (version == 3) return instantiate3("car", token, folder, false, false, false, false, NULL, 0, &messages, said3, NULL);
  snprintf(location, sizeof location, "file://%s", folder);
  return instantiate2("car", 1, token, location, &to_us, 0, 0);
}

static void wrong_use(int version, const char *folder, const char *token) {
  void *it, *state = NULL, *other = NULL;
  uint8_t *bytes;
  size_t size = 0;
  double value;
  int32_t whole;
  int (*state_of)(void *, void **) = of(version, version == 2 ? "GetFMUstate" : "GetFMUState");
  int (*restore)(void *, void *) = of(version, version == 2 ? "SetFMUstate" : "SetFMUState");
  int (*free_state)(void *, void **) = of(version, version == 2 ? "FreeFMUstate" : "FreeFMUState");
  int (*size_of)(void *, void *, size_t *) = of(version, version == 2 ? "SerializedFMUstateSize" : "SerializedFMUStateSize");
  int (*serialise)(void *, void *, uint8_t *, size_t) = of(version, version == 2 ? "SerializeFMUstate" : "SerializeFMUState");
  int (*deserialise)(void *, const uint8_t *, size_t, void **) = of(version, version == 2 ? "DeSerializeFMUstate" : "DeserializeFMUState");
  messages = 0;
  MUST(instantiate(version, folder, "{00000000-0000}") == NULL && messages == 1);
  MUST(instantiate(version, "/there/is/none", token) == NULL && messages == 2);
  MUST(instantiate(version, folder, "") == NULL && messages == 3);
  MUST(version == 3 || (instantiate2(NULL, 1, NULL, NULL, NULL, 0, 0) == NULL && instantiate2("car", 0, token, "file:///", NULL, 0, 0) == NULL));
  MUST(version == 2 || instantiate3(NULL, NULL, NULL, false, false, true, false, NULL, 0, NULL, NULL, NULL) == NULL);
  MUST(step(version, NULL, 0, 0.01) == 3 && simple(version, NULL, "Reset") == 3 && begin(version, NULL, 0) == 3);
  MUST((it = instantiate(version, folder, token)) != NULL);
  REFUSED(step(version, it, 0, 0.01));
  REFUSED(simple(version, it, "ExitInitializationMode"));
  REFUSED(begin(version, it, NAN));
  MUST(begin(version, it, 5.0) == 0);
  REFUSED(begin(version, it, 5.0));
  MUST(simple(version, it, "ExitInitializationMode") == 0);
  for (int at = 0; at < 4; at++) {
    const double lengths[] = {0.0, -0.01, NAN, INFINITY};
    REFUSED(step(version, it, 5.0, lengths[at]));
    REFUSED(step(version, it, at == 0 ? NAN : INFINITY, 0.01));
  }
  REFUSED(get_real(version, it, INPUTS, &value));
  REFUSED(get_real(version, it, 7, &value));
  REFUSED(get_real(version, it, UINT32_MAX, &value));
  REFUSED(get_real(version, it, ESTIMATES + ESTIMATE_WORDS, &value));
  REFUSED(get_real(version, it, ESTIMATES, &value));
  REFUSED(get_whole(version, it, INPUTS + 1, &whole));
  REFUSED(set_real(version, it, INPUTS + 3, 1.0));
  REFUSED(set_whole(version, it, INPUTS + 1, 1));
  REFUSED(set_real(version, it, ESTIMATES + 8, 1.0));
  REFUSED(get_real(version, it, INPUTS + 1, NULL));
  MUST(simple(version, it, version == 2 ? "GetRealStatus" : "EnterEventMode") == 3);
  /* Values that are no numbers, and gears of no table. */
  for (int at = 1; at < INPUT_WORDS; at++)
    MUST((input_kinds[at] == 'r' ? set_real(version, it, INPUTS + at, at % 2 ? NAN : 1e300) : set_whole(version, it, INPUTS + at, 99)) == 0);
  MUST(step(version, it, 5.0, 1e30) == 0 && step(version, it, 6.0, 0.01) == 0 && get_whole(version, it, ESTIMATES, &whole) == 0 && whole != 0);
  /* States: damaged, too short, none. */
  MUST(state_of(it, &state) == 0 && size_of(it, state, &size) == 0 && (bytes = malloc(size)) != NULL && serialise(it, state, bytes, size) == 0);
  REFUSED(serialise(it, state, bytes, size - 1));
  REFUSED(deserialise(it, bytes, size - 1, &other));
  REFUSED(deserialise(it, bytes, 0, &other));
  REFUSED(deserialise(it, NULL, size, &other));
  REFUSED(restore(it, NULL));
  REFUSED(state_of(it, NULL));
  for (size_t at = 0; at < size; at += at < 64 ? 1 : size / 50) {
    if (at >= 8 && at < 16) continue; /* the time may be any */
    bytes[at] ^= 0x10;
    REFUSED(deserialise(it, bytes, size, &other));
    bytes[at] ^= 0x10;
  }
  MUST(other == NULL && deserialise(it, bytes, size, &other) == 0 && restore(it, other) == 0);
  MUST(free_state(it, &other) == 0 && other == NULL && free_state(it, &other) == 0 && free_state(it, &state) == 0);
  free(bytes);
  MUST(simple(version, it, "Terminate") == 0);
  REFUSED(step(version, it, 6.0, 0.01));
  REFUSED(set_whole(version, it, INPUTS + 3, 1));
  REFUSED(simple(version, it, "Terminate"));
  MUST(simple(version, it, "Reset") == 0 && begin(version, it, 0.0) == 0);
  ((void (*)(void *))of(version, "FreeInstance"))(it);
  ((void (*)(void *))of(version, "FreeInstance"))(NULL);
}

/* A second instance steps with other inputs in between. */
static void drive(int version, char **names) {
  void *it = instantiate(version, names[2], names[3]), *other = instantiate(version, names[2], names[3]);
  FILE *from = fopen(names[4], "rb"), *to = fopen(names[version + 3], "wb");
  uint32_t input[2][INPUT_WORDS], word;
  double time_s = 0.0, value;
  float length_s;
  MUST(it != NULL && other != NULL && from != NULL && to != NULL && fread(input[0], sizeof input[0], 1, from) == 1);
  MUST(begin(version, it, 0.0) == 0 && simple(version, it, "ExitInitializationMode") == 0);
  MUST(begin(version, other, 0.0) == 0 && simple(version, other, "ExitInitializationMode") == 0);
  for (bool more = true; more; memcpy(input[0], input[1], sizeof input[0])) {
    for (int at = 1; at < INPUT_WORDS; at++) {
      float real;
      memcpy(&real, &input[0][at], 4);
      MUST((input_kinds[at] == 'r' ? set_real(version, it, INPUTS + at, real) : set_whole(version, it, INPUTS + at, (int32_t)input[0][at])) == 0);
    }
    more = fread(input[1], sizeof input[1], 1, from) == 1;
    /* The time from this input to the next one. */
    memcpy(&length_s, more ? &input[1][0] : &input[0][0], 4);
    MUST(step(version, it, time_s, length_s) == 0 && step(version, other, time_s, 0.02) == 0);
    time_s += length_s;
    for (int at = 0; at < ESTIMATE_WORDS; at++) {
      if (estimate_kinds[at] == 'r') {
        float real;
        MUST(get_real(version, it, ESTIMATES + at, &value) == 0);
        real = (float)value;
        memcpy(&word, &real, 4);
      } else {
        MUST(get_whole(version, it, ESTIMATES + at, (int32_t *)&word) == 0);
      }
      MUST(fwrite(&word, 4, 1, to) == 1);
    }
  }
  MUST(version == 2 || (get_real(3, it, 0, &value) == 0 && value == time_s));
  MUST(simple(version, it, "Terminate") == 0 && simple(version, other, "Terminate") == 0 && fclose(to) == 0);
  ((void (*)(void *))of(version, "FreeInstance"))(it);
  ((void (*)(void *))of(version, "FreeInstance"))(other);
}

int main(int count, char **names) {
  if (count != 7 || (library = dlopen(names[1], RTLD_NOW | RTLD_LOCAL)) == NULL) return printf("%s\n", dlerror()), 1;
  instantiate2 = of(2, "Instantiate");
  instantiate3 = of(3, "InstantiateCoSimulation");
  for (int version = 2; version <= 3; version++) {
    wrong_use(version, names[2], names[3]);
    drive(version, names);
  }
  return 0;
}
