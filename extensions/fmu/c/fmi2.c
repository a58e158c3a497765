/* The co-simulation interface of FMI 2.0 over a model that is one array of numbers. */
#include <stdlib.h>
#include <string.h>

#include "fmi2.h"
#include "model.h"

#define LONGEST 1000.0 /* s, of a communication step */

typedef struct {
    double v[COUNT + MEMORY];
    int running; /* after the initialization mode */
    fmi2CallbackFunctions callbacks;
    char name[128];
} Instance;

static const double START_VALUES[COUNT] = START;

static void reset(Instance *m) {
    memset(m->v, 0, sizeof m->v);
    memcpy(m->v, START_VALUES, sizeof START_VALUES);
    m->running = 0;
}

static fmi2Status refuse(fmi2Component c, fmi2String why) {
    const Instance *m = c;
    if (m->callbacks.logger)
        m->callbacks.logger(m->callbacks.componentEnvironment, m->name, fmi2Error,
                            "logStatusError", "%s", why);
    return fmi2Error;
}

static fmi2Status refuse_some(fmi2Component c, size_t n, fmi2String why) {
    return n ? refuse(c, why) : fmi2OK;
}

/* Whether a variable may be set now: outputs never, fixed parameters until it runs. */
static fmi2Status settable(Instance *m, fmi2ValueReference r) {
    if (r >= FIRST_OUTPUT && r < FIRST_INTEGER) return refuse(m, "an output cannot be set");
    if (m->running && (int)r < FIRST_TUNABLE)
        return refuse(m, "a fixed parameter can only be set before the simulation");
    return fmi2OK;
}

/* ---- the instance */
EXPORTED const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORTED const char *fmi2GetVersion(void) { return "2.0"; }

EXPORTED fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                                       fmi2String resources, const fmi2CallbackFunctions *callbacks,
                                       fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible, (void)logging;
    Instance *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    if (callbacks) m->callbacks = *callbacks;
    if (name) strncpy(m->name, name, sizeof m->name - 1);
    if (type != fmi2CoSimulation || !guid || strcmp(guid, GUID) != 0) {
        refuse(m, type != fmi2CoSimulation ? "it is for co-simulation only"
                                           : "modelDescription.xml is of another FMU: guid differs");
        free(m);
        return NULL;
    }
    reset(m);
    return m;
}

EXPORTED void fmi2FreeInstance(fmi2Component c) { free(c); }

EXPORTED fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n,
                                        const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories; /* only errors are logged */
    return fmi2OK;
}

EXPORTED fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                        fmi2Real start, fmi2Boolean has_stop, fmi2Real stop) {
    (void)c, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi2OK;
}

EXPORTED fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

EXPORTED fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *m = c;
    model_begin(m->v);
    m->running = 1;
    return fmi2OK;
}

EXPORTED fmi2Status fmi2Terminate(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

EXPORTED fmi2Status fmi2Reset(fmi2Component c) {
    reset(c);
    return fmi2OK;
}

EXPORTED fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_set_state) {
    (void)time, (void)no_set_state;
    Instance *m = c;
    if (!m->running) return refuse(m, "a step before the end of the initialization mode");
    if (!(h >= 0.0 && h <= LONGEST)) return refuse(m, "a step must last 0 to 1000 s");
    const char *wrong = model_step(m->v, h);
    return wrong ? refuse(m, wrong) : fmi2OK;
}

/* ---- its variables */
EXPORTED fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                fmi2Real value[]) {
    Instance *m = c;
    if (!m->running) model_begin(m->v); /* outputs follow what was set */
    for (size_t i = 0; i < n; i++) {
        if (r[i] >= FIRST_INTEGER) return refuse(m, "no real variable has this value reference");
        value[i] = m->v[r[i]];
    }
    return fmi2OK;
}

EXPORTED fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                const fmi2Real value[]) {
    Instance *m = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] >= FIRST_INTEGER) return refuse(m, "no real variable has this value reference");
        if (settable(m, r[i]) != fmi2OK) return fmi2Error;
        m->v[r[i]] = value[i];
    }
    return fmi2OK;
}

EXPORTED fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                   fmi2Integer value[]) {
    const Instance *m = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] < FIRST_INTEGER || r[i] >= COUNT)
            return refuse(c, "no integer variable has this value reference");
        value[i] = (fmi2Integer)m->v[r[i]];
    }
    return fmi2OK;
}

EXPORTED fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                   const fmi2Integer value[]) {
    Instance *m = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] < FIRST_INTEGER || r[i] >= COUNT)
            return refuse(c, "no integer variable has this value reference");
        m->v[r[i]] = value[i];
    }
    return fmi2OK;
}

/* ---- what the standard names and these models do not have */
EXPORTED fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                   fmi2Boolean value[]) {
    (void)r, (void)value;
    return refuse_some(c, n, "it has no boolean variables");
}
EXPORTED fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                   const fmi2Boolean value[]) {
    (void)r, (void)value;
    return refuse_some(c, n, "it has no boolean variables");
}
EXPORTED fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                  fmi2String value[]) {
    (void)r, (void)value;
    return refuse_some(c, n, "it has no string variables");
}
EXPORTED fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                  const fmi2String value[]) {
    (void)r, (void)value;
    return refuse_some(c, n, "it has no string variables");
}
EXPORTED fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                                const fmi2Integer order[], const fmi2Real value[]) {
    (void)r, (void)order, (void)value;
    return refuse_some(c, n, "it has no derivatives of inputs");
}
EXPORTED fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[],
                                                 size_t n, const fmi2Integer order[],
                                                 fmi2Real value[]) {
    (void)r, (void)order, (void)value;
    return refuse_some(c, n, "it has no derivatives of outputs");
}
EXPORTED fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
                                                 size_t n_unknown, const fmi2ValueReference known[],
                                                 size_t n_known, const fmi2Real change[],
                                                 fmi2Real value[]) {
    (void)unknown, (void)n_unknown, (void)known, (void)n_known, (void)change, (void)value;
    return refuse(c, "it has no directional derivatives");
}
EXPORTED fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)state;
    return refuse(c, "its state cannot be taken");
}
EXPORTED fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    (void)state;
    return refuse(c, "its state cannot be set");
}
EXPORTED fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c, (void)state; /* none was ever given */
    return fmi2OK;
}
EXPORTED fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)state, (void)size;
    return refuse(c, "its state cannot be taken");
}
EXPORTED fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte data[],
                                          size_t size) {
    (void)state, (void)data, (void)size;
    return refuse(c, "its state cannot be taken");
}
EXPORTED fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte data[], size_t size,
                                            fmi2FMUstate *state) {
    (void)data, (void)size, (void)state;
    return refuse(c, "its state cannot be set");
}
EXPORTED fmi2Status fmi2CancelStep(fmi2Component c) {
    return refuse(c, "a step ends before its call returns");
}

/* Only steps that end later have a status to ask for. */
EXPORTED fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
EXPORTED fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
EXPORTED fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind,
                                         fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
EXPORTED fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind,
                                         fmi2Boolean *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
EXPORTED fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
