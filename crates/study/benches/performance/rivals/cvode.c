/* Two seconds in first gear with CVODE: a rival for `cargo bench -p study --bench performance`.
 *
 * Reads the car's parameters, one field in a line: its name and its numbers. Prints the derivative at the start, then for
 * each method, problem and tolerance a line: name, problem, time in s, end state. The inputs jump from piece to piece, so each piece
 * begins with `CVodeReInit`, as CVODE's guide asks for. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#define STATES 8
#define MOST_FIELDS 64
#define MEASURED_S 0.15

struct field {
    char name[64];
    int count;
    double *values;
};

static struct field fields[MOST_FIELDS];
static int field_count;

static struct field *field(const char *name) {
    for (int i = 0; i < field_count; i++)
        if (!strcmp(fields[i].name, name)) return &fields[i];
    fprintf(stderr, "no field %s\n", name);
    exit(1);
}

static double *numbers(const char *name) { return field(name)->values; }

static void read_fields(void) {
    char *line = NULL;
    size_t size = 0;
    while (getline(&line, &size, stdin) > 0 && field_count < MOST_FIELDS) {
        struct field *f = &fields[field_count];
        int used = 0;
        if (sscanf(line, "%63s%n", f->name, &used) != 1) continue;
        f->values = malloc((strlen(line) + 1) * sizeof(double));
        char *at = line + used, *end;
        for (;; at = end) {
            double value = strtod(at, &end);
            if (end == at) break;
            f->values[f->count++] = value;
        }
        field_count++;
    }
    free(line);
}

/* A function given by breakpoints: its end value outside of them. */
struct table {
    int count;
    const double *x, *y;
};

static struct table table(const char *x, const char *y) {
    return (struct table){field(x)->count, numbers(x), numbers(y)};
}

static inline int segment(int count, const double *axis, double x) {
    int i = 0;
    while (i + 2 < count && axis[i + 1] <= x) i++;
    return i;
}

static inline double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static inline double at(const struct table *t, double x) {
    x = clamp(x, t->x[0], t->x[t->count - 1]);
    int i = segment(t->count, t->x, x);
    return t->y[i] + (t->y[i + 1] - t->y[i]) / (t->x[i + 1] - t->x[i]) * (x - t->x[i]);
}

static struct car {
    struct table capacity, torque_ratio, friction, lag, engine;
    const double *inertia, *turbine_row, *output_row, *slip_row, *clutch, *settled, *driveline, *tyre, *road;
    double engine_torque[64];
} car;

/* The engine's map at this throttle, which stays for a piece. */
static void set_throttle(double throttle) {
    struct field *positions = field("throttle"), *map = field("engine_map");
    throttle = clamp(throttle, positions->values[0], positions->values[positions->count - 1]);
    int j = segment(positions->count, positions->values, throttle);
    double share = (throttle - positions->values[j]) / (positions->values[j + 1] - positions->values[j]);
    for (int i = 0; i < car.engine.count; i++) {
        const double *row = map->values + i * positions->count + j;
        car.engine_torque[i] = row[0] + share * (row[1] - row[0]);
    }
}

static int rates(sunrealtype time, N_Vector state, N_Vector slope, void *unused) {
    (void)time, (void)unused;
    const double *x = N_VGetArrayPointer(state);
    double *dx = N_VGetArrayPointer(slope);
    double engine = x[0], turbine = x[1], output = x[2], twist = x[3], wheel = x[4], vehicle = x[5];
    double speed_ratio = turbine / engine;
    double pump = at(&car.capacity, speed_ratio) * engine * engine;
    double turbine_torque = at(&car.torque_ratio, speed_ratio) * pump;
    double slip = car.slip_row[0] * turbine + car.slip_row[1] * output;
    double force = car.clutch[1] * x[7] - car.clutch[2];
    double clutch = force > 0.0 ? copysign(at(&car.friction, fabs(slip)) * car.clutch[0] * force, slip) : 0.0;
    double ratio = car.driveline[0], radius = car.road[1];
    double twist_rate = output / ratio - wheel;
    double shaft = car.driveline[1] * twist + car.driveline[2] * twist_rate;
    double rim = radius * wheel;
    double reference = fmax(fmax(fabs(rim), fabs(vehicle)), car.tyre[2]);
    double tyre = car.tyre[0] * tanh(2.0 * (rim - vehicle) / reference / car.tyre[1]);
    double load = shaft / ratio;
    dx[0] = (at(&car.engine, engine) - car.inertia[1] * engine - pump) / car.inertia[0];
    dx[1] = car.turbine_row[0] * turbine_torque + car.turbine_row[1] * clutch + car.turbine_row[2] * load;
    dx[2] = car.output_row[0] * turbine_torque + car.output_row[1] * clutch + car.output_row[2] * load;
    dx[3] = twist_rate;
    dx[4] = (shaft - car.road[3] - radius * tyre) / car.driveline[3];
    dx[5] = (tyre - car.road[2] * vehicle * fabs(vehicle) - car.road[4]) / car.road[0];
    dx[6] = (car.settled[0] - x[6]) / at(&car.lag, x[6]);
    dx[7] = (car.settled[1] - x[7]) / at(&car.lag, x[7]);
    return 0;
}

static double now_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

/* Pieces of constant inputs, one after the other; nonzero where the method fails. */
static int solve(void *cvode, N_Vector x, const struct field *throttle, double piece_s) {
    memcpy(N_VGetArrayPointer(x), numbers("start"), STATES * sizeof(double));
    for (int piece = 0; piece < throttle->count; piece++) {
        set_throttle(throttle->values[piece]);
        double time;
        if (CVodeReInit(cvode, 0.0, x) || CVodeSetStopTime(cvode, piece_s)) return 1;
        if (CVode(cvode, piece_s, x, &time, CV_NORMAL) < 0) return 1;
    }
    return 0;
}

static void measure(int method, const char *name, SUNContext context) {
    N_Vector x = N_VNew_Serial(STATES, context), absolute = N_VNew_Serial(STATES, context);
    struct field *tolerances = field("tolerances");
    const char *problems[] = {"constant", "changing"};
    for (int problem = 0; problem < 2; problem++) {
        const struct field *throttle = field(problems[problem]);
        double piece_s = numbers("span")[0] / throttle->count;
        for (int tried = 0; tried < tolerances->count; tried++) {
            double relative = tolerances->values[tried];
            for (int i = 0; i < STATES; i++) N_VGetArrayPointer(absolute)[i] = relative * numbers("scale")[i];
            memcpy(N_VGetArrayPointer(x), numbers("start"), STATES * sizeof(double));
            void *cvode = CVodeCreate(method, context);
            SUNMatrix matrix = NULL;
            SUNLinearSolver linear = NULL;
            SUNNonlinearSolver nonlinear = NULL;
            int wrong = CVodeInit(cvode, rates, 0.0, x) || CVodeSVtolerances(cvode, relative, absolute);
            wrong = wrong || CVodeSetMaxNumSteps(cvode, 100000);
            if (method == CV_BDF) {
                matrix = SUNDenseMatrix(STATES, STATES, context);
                linear = SUNLinSol_Dense(x, matrix, context);
                wrong = wrong || CVodeSetLinearSolver(cvode, linear, matrix);
            } else {
                nonlinear = SUNNonlinSol_FixedPoint(x, 0, context);
                wrong = wrong || CVodeSetNonlinearSolver(cvode, nonlinear);
            }
            double best = INFINITY, began = now_s();
            for (int round = 0; !wrong && (round < 3 || now_s() - began < MEASURED_S); round++) {
                double start = now_s();
                wrong = solve(cvode, x, throttle, piece_s);
                best = fmin(best, now_s() - start);
            }
            if (!wrong) {
                printf("%s %s %.17g", name, problems[problem], best);
                for (int i = 0; i < STATES; i++) printf(" %.17g", N_VGetArrayPointer(x)[i]);
                printf("\n");
            }
            CVodeFree(&cvode);
            if (linear) SUNLinSolFree(linear);
            if (matrix) SUNMatDestroy(matrix);
            if (nonlinear) SUNNonlinSolFree(nonlinear);
        }
    }
    N_VDestroy(x);
    N_VDestroy(absolute);
}

int main(void) {
    read_fields();
    car.capacity = table("speed_ratio", "capacity");
    car.torque_ratio = table("speed_ratio", "torque_ratio");
    car.friction = table("friction_slip", "friction");
    car.lag = table("lag_pressure", "lag");
    car.engine = (struct table){field("engine_speed")->count, numbers("engine_speed"), car.engine_torque};
    if (car.engine.count > 64) return 1;
    car.inertia = numbers("engine");
    car.turbine_row = numbers("turbine_row");
    car.output_row = numbers("output_row");
    car.slip_row = numbers("slip_row");
    car.clutch = numbers("clutch");
    car.settled = numbers("settled");
    car.driveline = numbers("driveline");
    car.tyre = numbers("tyre");
    car.road = numbers("road");
    SUNContext context;
    if (SUNContext_Create(NULL, &context)) return 1;
    N_Vector x = N_VNew_Serial(STATES, context), slope = N_VNew_Serial(STATES, context);
    memcpy(N_VGetArrayPointer(x), numbers("start"), STATES * sizeof(double));
    set_throttle(numbers("constant")[0]);
    rates(0.0, x, slope, NULL);
    for (int i = 0; i < STATES; i++) printf("%.17g ", N_VGetArrayPointer(slope)[i]);
    printf("\n");
    N_VDestroy(x);
    N_VDestroy(slope);
    measure(CV_BDF, "bdf", context);
    measure(CV_ADAMS, "adams", context);
    SUNContext_Free(&context);
    return 0;
}
