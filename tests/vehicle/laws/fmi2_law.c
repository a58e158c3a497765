/* The same law for FMI 2, with scalars NAME[1], NAME[2], ...: compiled by the tests. */
#include <stdlib.h>
#include <string.h>

typedef void *Component;
typedef unsigned int Reference;
typedef int Status;

enum { POSITION = 0, VELOCITY = 3, QUATERNION = 6, RATES = 10, WANTED = 13, WANTED_V = 16,
       WANTED_A = 19, INERTIA = 22, MASS = 25, THRUST = 26, TORQUE = 27, COUNT = 30 };

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
Component fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                          const void *functions, int visible, int logging) {
    return calloc(COUNT, sizeof(double));
}
void fmi2FreeInstance(Component c) { free(c); }
Status fmi2SetupExperiment(Component c, int d, double t, double start, int s, double stop) {
    return 0;
}
Status fmi2EnterInitializationMode(Component c) { return 0; }
Status fmi2ExitInitializationMode(Component c) { return 0; }
Status fmi2Terminate(Component c) { return 0; }
Status fmi2Reset(Component c) { memset(c, 0, COUNT * sizeof(double)); return 0; }
Status fmi2SetDebugLogging(Component c, int on, size_t n, const char *const kinds[]) { return 0; }
Status fmi2SetReal(Component c, const Reference r[], size_t n, const double value[]) {
    for (size_t i = 0; i < n; i++) ((double *)c)[r[i]] = value[i];
    return 0;
}
Status fmi2GetReal(Component c, const Reference r[], size_t n, double value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((double *)c)[r[i]];
    return 0;
}
Status fmi2DoStep(Component c, double time, double step, int no_set_state) {
    double *v = c, a[3];
    const double kp[3] = {4.0, 4.0, 8.0}, kv[3] = {3.5, 3.5, 5.0};
    for (int i = 0; i < 3; i++)
        a[i] = kp[i] * (v[WANTED + i] - v[POSITION + i])
             + kv[i] * (v[WANTED_V + i] - v[VELOCITY + i]) + v[WANTED_A + i];
    const double *q = v + QUATERNION;
    const double wanted[3] = {-a[1] / 9.81, a[0] / 9.81, 0.0};
    const double tilt[3] = {2.0 * (q[0] * q[1] + q[2] * q[3]), 2.0 * (q[0] * q[2] - q[1] * q[3]),
                            2.0 * q[0] * q[3]};
    const double kr[3] = {60.0, 60.0, 12.0}, kw[3] = {12.0, 12.0, 5.0};
    for (int i = 0; i < 3; i++)
        v[TORQUE + i] = v[INERTIA + i] * (kr[i] * (wanted[i] - tilt[i]) - kw[i] * v[RATES + i]);
    v[THRUST] = v[MASS] * (9.81 + a[2]);
    return 0;
}

/* What every FMU must offer, and no law needs. */
#define REFUSED(name) Status name(void) { return 3; }
REFUSED(fmi2GetInteger) REFUSED(fmi2GetBoolean) REFUSED(fmi2GetString)
REFUSED(fmi2SetInteger) REFUSED(fmi2SetBoolean) REFUSED(fmi2SetString)
REFUSED(fmi2GetFMUstate) REFUSED(fmi2SetFMUstate) REFUSED(fmi2FreeFMUstate)
REFUSED(fmi2SerializedFMUstateSize) REFUSED(fmi2SerializeFMUstate)
REFUSED(fmi2DeSerializeFMUstate) REFUSED(fmi2GetDirectionalDerivative)
REFUSED(fmi2SetRealInputDerivatives) REFUSED(fmi2GetRealOutputDerivatives)
REFUSED(fmi2CancelStep) REFUSED(fmi2GetStatus) REFUSED(fmi2GetRealStatus)
REFUSED(fmi2GetIntegerStatus) REFUSED(fmi2GetBooleanStatus) REFUSED(fmi2GetStringStatus)
