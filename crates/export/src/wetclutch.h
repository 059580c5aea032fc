/* The gearbox filter of wetclutch on a transmission controller.
 *
 * Link with libwetclutch.a, or compile wetclutch.c. Nothing is allocated and no static data is written: it may be used for several observers and
 * from several tasks, if no two of them use the same memory at a time. Quantities are in SI units; a name ends in its unit.
 */
#ifndef WETCLUTCH_H
#define WETCLUTCH_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Places for elements; a car may have fewer. */
#define WETCLUTCH_ELEMENTS 8u

@STATUS@
/* Bits of wetclutch_estimate.given. */
#define WETCLUTCH_GIVEN_GEAR 0x1u         /* gear_from, gear_to, phase */
#define WETCLUTCH_GIVEN_CLUTCHES 0x2u     /* offgoing, oncoming */
#define WETCLUTCH_GIVEN_TURBINE 0x4u      /* turbine_n_m */
#define WETCLUTCH_GIVEN_SHAFT 0x8u        /* shaft_n_m */
#define WETCLUTCH_GIVEN_INPUT_CLUTCH 0x10u /* input_clutch_n_m */
#define WETCLUTCH_GIVEN_AT_TURBINE 0x20u  /* at_turbine_n_m */
#define WETCLUTCH_GIVEN_ELEMENT_RANGE(element) (0x100u << (element)) /* element_range_pa[element] */

/* Bits of wetclutch_clutch.flags. */
#define WETCLUTCH_CLUTCH_HOLDS 0x1u  /* the clutch holds */
#define WETCLUTCH_CLUTCH_HIDDEN 0x2u /* the speeds show nothing of its torque: the estimate is that of the valve model */
#define WETCLUTCH_CLUTCH_RANGE 0x4u  /* there are guaranteed ranges */

/* A reading of a channel. Give one when it comes, and none (came = 0) where none came: a repeated reading says that nothing changed. */
typedef struct {
  float value;   /* in the unit of the channel */
  float age_s;   /* time from the moment when it was measured until this step, s */
  uint32_t came; /* 1 if a reading came since the step before, else 0 */
} wetclutch_reading;

/* What came since the step before. */
typedef struct {
  float dt_s;                     /* time since the step before, s; not used in the first step */
  wetclutch_reading engine_rad_s;  /* engine speed, rad/s */
  wetclutch_reading turbine_rad_s; /* turbine speed, rad/s */
  wetclutch_reading output_rad_s;  /* speed of the gearbox output, rad/s */
  wetclutch_reading wheel_rad_s;   /* speed of the driven wheels, rad/s */
  wetclutch_reading engine_n_m;    /* engine torque as the engine's controller reports it, N m */
  wetclutch_reading acceleration_m_s2; /* longitudinal acceleration by an accelerometer, with the part of gravity along the road, m/s^2 */
  wetclutch_reading oil_degc;      /* temperature of the oil in the gearbox, degC */
  uint32_t lock_up_applied;       /* 1 while the lock-up clutch of the converter carries torque */
  int32_t gear_from;              /* place of the gear before, -1 neutral; the gear itself while there is no shift */
  int32_t gear_to;                /* place of the gear after, -1 neutral */
  wetclutch_reading commands[WETCLUTCH_ELEMENTS]; /* commands of the valves, A or %, by the places of the elements */
} wetclutch_input;

/* A clutch of a shift. */
typedef struct {
  int32_t element;            /* place of the element, -1 of a one-way clutch */
  uint32_t flags;             /* WETCLUTCH_CLUTCH_... */
  float pressure_pa;          /* cylinder pressure, Pa */
  float torque_n_m;           /* torque, N m, positive when it drives its output side */
  float std_dev_n_m;        /* standard deviation of the torque, N m */
  float pressure_std_dev_pa;  /* standard deviation of the pressure, Pa */
  float valve_pa;             /* pressure by the models of valve and piston alone, Pa */
  float open_loop_n_m;        /* torque by these models and friction alone, N m */
  float pressure_range_pa[2]; /* lowest and highest pressure for errors within the budget, Pa */
  float torque_range_n_m[2];  /* lowest and highest torque for errors within the budget, N m */
} wetclutch_clutch;

/* The estimate after a step. What is not given is zero. */
typedef struct {
  uint32_t status;                     /* WETCLUTCH_STATUS_..., 0 if everything is right */
  uint32_t given;                      /* WETCLUTCH_GIVEN_... */
  uint32_t health;                     /* WETCLUTCH_HEALTH_..., 0 good */
  int32_t gear_from;                   /* place of the gear before the shift that the filter is in, -1 none */
  int32_t gear_to;                     /* place of the gear after it, -1 none */
  int32_t phase;                       /* 0 in gear, 1 offgoing holds, 2 both slip, 3 oncoming holds, -1 none */
  wetclutch_clutch offgoing;           /* the clutch that opens */
  wetclutch_clutch oncoming;           /* the clutch that closes */
  float flare_rad_s;                   /* slip of the offgoing clutch away from the new gear, at the turbine, rad/s */
  float turbine_n_m;                   /* torque at the gearbox input, N m */
  float shaft_n_m;                     /* torque of the drive shafts, N m */
  float input_clutch_n_m[2];           /* torque of the clutch between engine and gearbox, N m, and its standard deviation */
  float at_turbine_n_m[2];             /* torque of all clutches at the turbine, N m, and its standard deviation */
  float element_pa[WETCLUTCH_ELEMENTS]; /* pressure of each element by the models of its valve and piston, Pa */
  float element_range_pa[WETCLUTCH_ELEMENTS][2]; /* lowest and highest pressure of each element, Pa */
  uint32_t channels[6];                /* engine, turbine, output, wheel speed, engine torque, acceleration: WETCLUTCH_CHANNEL_... */
  uint32_t commands[WETCLUTCH_ELEMENTS]; /* the same of the commands */
} wetclutch_estimate;

/* What became of a channel in a step. */
#define WETCLUTCH_CHANNEL_UNUSED 0u  /* the filter does without it */
#define WETCLUTCH_CHANNEL_GOOD 1u    /* its reading was taken */
#define WETCLUTCH_CHANNEL_ABSENT 2u  /* no reading came */
#define WETCLUTCH_CHANNEL_REFUSED 3u /* its reading was refused */
#define WETCLUTCH_CHANNEL_LOST 4u    /* it has given no usable reading for 0.25 s */

@HEALTH@
/* What was learnt, to be kept while the ignition is off. */
#define WETCLUTCH_LEARNT_WORDS @LEARNT@u
typedef struct {
  uint32_t words[WETCLUTCH_LEARNT_WORDS];
} wetclutch_learnt;

/* Memory that the observer of an image needs, bytes; 0 if the image cannot be used. */
uint32_t wetclutch_memory_size(const uint32_t *image, uint32_t image_bytes);

/* Builds the observer of an image in this memory, with nothing learnt. Returns a status; unless it is 0 the memory holds no observer.
 * The image is not needed afterwards. The memory may be copied and moved as bytes. Set its first word to zero at power-on if `step` may
 * come before `init`. */
uint32_t wetclutch_init(uint64_t *memory, uint32_t memory_bytes, const uint32_t *image, uint32_t image_bytes);

/* Takes what came since the step before and gives the estimate for now. Returns its status. */
uint32_t wetclutch_step(uint64_t *memory, const wetclutch_input *input, wetclutch_estimate *estimate);

/* Begins anew with what was learnt, as after a reset in a drive. */
uint32_t wetclutch_reset(uint64_t *memory);

/* Writes what was learnt, as at the end of a drive. */
uint32_t wetclutch_learnt_get(uint64_t *memory, wetclutch_learnt *learnt);

/* Begins a new drive with what was learnt in another one. With another status than 0 nothing has changed. */
uint32_t wetclutch_learnt_set(uint64_t *memory, const wetclutch_learnt *learnt);

/* Writes size and checksum into an image in RAM whose values were tuned; then call wetclutch_init. */
uint32_t wetclutch_seal(uint32_t *image, uint32_t image_bytes);

#ifdef __cplusplus
}
#endif
#endif
