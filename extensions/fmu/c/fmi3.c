/* The co-simulation interface of FMI 3.0 over a model that is one array of numbers.
 *
 * The value reference of an array is the place of its first number; COUNT is that of time. */
#include <stdlib.h>
#include <string.h>

#include "fmi3.h"
#include "model.h"

#define LONGEST 1000.0 /* s, of a communication step */

typedef struct {
    double v[COUNT + MEMORY];
    double time;
    bool running; /* after the initialization mode */
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

typedef fmi3ValueReference Ref;

static const double START_VALUES[COUNT] = START;
static const unsigned char SIZE[COUNT] = SIZES; /* numbers of the variable that begins there, or 0 */

static void reset(Instance *m) {
    memset(m->v, 0, sizeof m->v);
    memcpy(m->v, START_VALUES, sizeof START_VALUES);
    m->time = 0.0;
    m->running = false;
}

static fmi3Status refuse(fmi3Instance c, fmi3String why) {
    const Instance *m = c;
    if (m->log) m->log(m->environment, fmi3Error, "logStatusError", why);
    return fmi3Error;
}

static fmi3Status refuse_some(fmi3Instance c, size_t n, fmi3String why) {
    return n ? refuse(c, why) : fmi3OK;
}

/* Returns how many numbers a variable has, 0 for one that is not there or of the other type. */
static size_t size_of(Ref r, bool integer) {
    return r < COUNT && (r >= FIRST_INTEGER) == integer ? SIZE[r] : 0;
}

/* ---- the instance */
EXPORTED const char *fmi3GetVersion(void) { return "3.0"; }

EXPORTED fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean events, fmi3Boolean early, const Ref required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early;
    (void)required, (void)n, (void)update; /* no step ends early, and none has events */
    Instance *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    m->environment = environment;
    m->log = log;
    if (!token || strcmp(token, GUID) != 0) {
        refuse(m, "modelDescription.xml is of another FMU: instantiationToken differs");
        free(m);
        return NULL;
    }
    reset(m);
    return m;
}

EXPORTED fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token,
                                                   fmi3String resources, fmi3Boolean visible,
                                                   fmi3Boolean logging,
                                                   fmi3InstanceEnvironment environment,
                                                   fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (log) log(environment, fmi3Error, "logStatusError", "it is for co-simulation only");
    return NULL;
}

EXPORTED fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    (void)clock, (void)lock, (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, log);
}

EXPORTED void fmi3FreeInstance(fmi3Instance c) { free(c); }

EXPORTED fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n,
                                        const fmi3String categories[]) {
    (void)c, (void)on, (void)n, (void)categories; /* only errors are logged */
    return fmi3OK;
}

EXPORTED fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance,
                                                fmi3Float64 tolerance, fmi3Float64 start,
                                                fmi3Boolean has_stop, fmi3Float64 stop) {
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    ((Instance *)c)->time = start;
    return fmi3OK;
}

EXPORTED fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    Instance *m = c;
    model_begin(m->v);
    m->running = true;
    return fmi3OK;
}

EXPORTED fmi3Status fmi3Terminate(fmi3Instance c) {
    (void)c;
    return fmi3OK;
}

EXPORTED fmi3Status fmi3Reset(fmi3Instance c) {
    reset(c);
    return fmi3OK;
}

EXPORTED fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    (void)c;
    return fmi3OK;
}

EXPORTED fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h,
                               fmi3Boolean no_set_state, fmi3Boolean *events, fmi3Boolean *ends,
                               fmi3Boolean *early, fmi3Float64 *reached) {
    (void)no_set_state;
    Instance *m = c;
    *events = *ends = *early = false;
    *reached = time;
    if (!m->running) return refuse(m, "a step before the end of the initialization mode");
    if (!(h >= 0.0 && h <= LONGEST)) return refuse(m, "a step must last 0 to 1000 s");
    const char *wrong = model_step(m->v, h);
    if (wrong) return refuse(m, wrong);
    *reached = m->time = time + h;
    return fmi3OK;
}

/* ---- its variables */
EXPORTED fmi3Status fmi3GetFloat64(fmi3Instance c, const Ref r[], size_t n, fmi3Float64 value[],
                                   size_t n_values) {
    Instance *m = c;
    size_t k = 0;
    if (!m->running) model_begin(m->v); /* outputs follow what was set */
    for (size_t i = 0; i < n; i++) {
        const size_t size = r[i] == COUNT ? 1 : size_of(r[i], false);
        if (!size) return refuse(m, "no Float64 variable has this value reference");
        if (k + size > n_values) return refuse(m, "too few values for these variables");
        memcpy(value + k, r[i] == COUNT ? &m->time : m->v + r[i], size * sizeof *value);
        k += size;
    }
    return k == n_values ? fmi3OK : refuse(m, "too many values for these variables");
}

EXPORTED fmi3Status fmi3SetFloat64(fmi3Instance c, const Ref r[], size_t n, const fmi3Float64 value[],
                                   size_t n_values) {
    Instance *m = c;
    size_t k = 0;
    for (size_t i = 0; i < n; i++) {
        const size_t size = size_of(r[i], false);
        if (!size) return refuse(m, "no Float64 variable has this value reference");
        if (r[i] >= FIRST_OUTPUT) return refuse(m, "an output cannot be set");
        if (m->running && (int)r[i] < FIRST_TUNABLE)
            return refuse(m, "a fixed parameter can only be set before the simulation");
        if (k + size > n_values) return refuse(m, "too few values for these variables");
        memcpy(m->v + r[i], value + k, size * sizeof *value);
        k += size;
    }
    return k == n_values ? fmi3OK : refuse(m, "too many values for these variables");
}

EXPORTED fmi3Status fmi3GetInt32(fmi3Instance c, const Ref r[], size_t n, fmi3Int32 value[],
                                 size_t n_values) {
    const Instance *m = c;
    if (n != n_values) return refuse(c, "integers have one value each");
    for (size_t i = 0; i < n; i++) {
        if (!size_of(r[i], true)) return refuse(c, "no Int32 variable has this value reference");
        value[i] = (fmi3Int32)m->v[r[i]];
    }
    return fmi3OK;
}

EXPORTED fmi3Status fmi3SetInt32(fmi3Instance c, const Ref r[], size_t n, const fmi3Int32 value[],
                                 size_t n_values) {
    Instance *m = c;
    if (n != n_values) return refuse(c, "integers have one value each");
    for (size_t i = 0; i < n; i++) {
        if (!size_of(r[i], true)) return refuse(c, "no Int32 variable has this value reference");
        m->v[r[i]] = value[i];
    }
    return fmi3OK;
}

/* ---- what the standard names and these models do not have */
#define NONE_OF(type)                                                                               \
    EXPORTED fmi3Status fmi3Get##type(fmi3Instance c, const Ref r[], size_t n, fmi3##type value[],  \
                                      size_t n_values) {                                            \
        (void)r, (void)value, (void)n_values;                                                       \
        return refuse_some(c, n, "it has no variables of type " #type);                             \
    }                                                                                               \
    EXPORTED fmi3Status fmi3Set##type(fmi3Instance c, const Ref r[], size_t n,                      \
                                      const fmi3##type value[], size_t n_values) {                  \
        (void)r, (void)value, (void)n_values;                                                       \
        return refuse_some(c, n, "it has no variables of type " #type);                             \
    }
NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(Int64)
NONE_OF(UInt64)
NONE_OF(Boolean)
NONE_OF(String)

EXPORTED fmi3Status fmi3GetBinary(fmi3Instance c, const Ref r[], size_t n, size_t sizes[],
                                  fmi3Binary value[], size_t n_values) {
    (void)r, (void)sizes, (void)value, (void)n_values;
    return refuse_some(c, n, "it has no variables of type Binary");
}
EXPORTED fmi3Status fmi3SetBinary(fmi3Instance c, const Ref r[], size_t n, const size_t sizes[],
                                  const fmi3Binary value[], size_t n_values) {
    (void)r, (void)sizes, (void)value, (void)n_values;
    return refuse_some(c, n, "it has no variables of type Binary");
}

/* Functions of a tool that asks for what the description says is not there: all are refused. */
#define REFUSED(name, why, ...)                                                                     \
    EXPORTED fmi3Status name(fmi3Instance c, ##__VA_ARGS__) { return refuse(c, why); }
#define NO_CLOCKS "it has no clocks"
#define NO_STATE "its state cannot be taken or set"
#define NO_DERIVATIVES "it gives no derivatives"
#define NO_MODES "it has initialization and step mode alone"
#define NO_EXCHANGE "it is for co-simulation only"
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
REFUSED(fmi3GetClock, NO_CLOCKS, const Ref r[], size_t n, fmi3Clock value[])
REFUSED(fmi3SetClock, NO_CLOCKS, const Ref r[], size_t n, const fmi3Clock value[])
REFUSED(fmi3GetIntervalDecimal, NO_CLOCKS, const Ref r[], size_t n, fmi3Float64 intervals[],
        fmi3IntervalQualifier kinds[])
REFUSED(fmi3GetIntervalFraction, NO_CLOCKS, const Ref r[], size_t n, fmi3UInt64 counters[],
        fmi3UInt64 resolutions[], fmi3IntervalQualifier kinds[])
REFUSED(fmi3GetShiftDecimal, NO_CLOCKS, const Ref r[], size_t n, fmi3Float64 shifts[])
REFUSED(fmi3GetShiftFraction, NO_CLOCKS, const Ref r[], size_t n, fmi3UInt64 counters[],
        fmi3UInt64 resolutions[])
REFUSED(fmi3SetIntervalDecimal, NO_CLOCKS, const Ref r[], size_t n, const fmi3Float64 intervals[])
REFUSED(fmi3SetIntervalFraction, NO_CLOCKS, const Ref r[], size_t n, const fmi3UInt64 counters[],
        const fmi3UInt64 resolutions[])
REFUSED(fmi3SetShiftDecimal, NO_CLOCKS, const Ref r[], size_t n, const fmi3Float64 shifts[])
REFUSED(fmi3SetShiftFraction, NO_CLOCKS, const Ref r[], size_t n, const fmi3UInt64 counters[],
        const fmi3UInt64 resolutions[])
REFUSED(fmi3ActivateModelPartition, NO_CLOCKS, Ref clock, fmi3Float64 time)
REFUSED(fmi3GetNumberOfVariableDependencies, "its dependencies are those of the description", Ref r,
        size_t *n)
REFUSED(fmi3GetVariableDependencies, "its dependencies are those of the description", Ref r,
        size_t elements[], Ref independents[], size_t of_independents[], fmi3DependencyKind kinds[],
        size_t n)
REFUSED(fmi3GetFMUState, NO_STATE, fmi3FMUState *state)
REFUSED(fmi3SetFMUState, NO_STATE, fmi3FMUState state)
REFUSED(fmi3SerializedFMUStateSize, NO_STATE, fmi3FMUState state, size_t *size)
REFUSED(fmi3SerializeFMUState, NO_STATE, fmi3FMUState state, fmi3Byte data[], size_t size)
REFUSED(fmi3DeserializeFMUState, NO_STATE, const fmi3Byte data[], size_t size, fmi3FMUState *state)
REFUSED(fmi3GetDirectionalDerivative, NO_DERIVATIVES, const Ref unknowns[], size_t n_unknowns,
        const Ref knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
        fmi3Float64 sensitivity[], size_t n_sensitivity)
REFUSED(fmi3GetAdjointDerivative, NO_DERIVATIVES, const Ref unknowns[], size_t n_unknowns,
        const Ref knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
        fmi3Float64 sensitivity[], size_t n_sensitivity)
REFUSED(fmi3GetOutputDerivatives, NO_DERIVATIVES, const Ref r[], size_t n, const fmi3Int32 orders[],
        fmi3Float64 values[], size_t n_values)
REFUSED(fmi3EnterEventMode, NO_MODES)
REFUSED(fmi3EnterConfigurationMode, NO_MODES)
REFUSED(fmi3ExitConfigurationMode, NO_MODES)
REFUSED(fmi3EvaluateDiscreteStates, NO_MODES)
REFUSED(fmi3UpdateDiscreteStates, NO_MODES, fmi3Boolean *update, fmi3Boolean *ends,
        fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *has_next, fmi3Float64 *next)

REFUSED(fmi3EnterContinuousTimeMode, NO_EXCHANGE)
REFUSED(fmi3CompletedIntegratorStep, NO_EXCHANGE, fmi3Boolean no_set_state, fmi3Boolean *events,
        fmi3Boolean *ends)
REFUSED(fmi3SetTime, NO_EXCHANGE, fmi3Float64 time)
REFUSED(fmi3SetContinuousStates, NO_EXCHANGE, const fmi3Float64 x[], size_t n)
REFUSED(fmi3GetContinuousStates, NO_EXCHANGE, fmi3Float64 x[], size_t n)
REFUSED(fmi3GetContinuousStateDerivatives, NO_EXCHANGE, fmi3Float64 x[], size_t n)
REFUSED(fmi3GetNominalsOfContinuousStates, NO_EXCHANGE, fmi3Float64 x[], size_t n)
REFUSED(fmi3GetEventIndicators, NO_EXCHANGE, fmi3Float64 z[], size_t n)
REFUSED(fmi3GetNumberOfEventIndicators, NO_EXCHANGE, size_t *n)
REFUSED(fmi3GetNumberOfContinuousStates, NO_EXCHANGE, size_t *n)

EXPORTED fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    (void)c, (void)state; /* none was ever given */
    return fmi3OK;
}
