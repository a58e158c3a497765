/* Betaflight's own CRSF receiver in a process of its own: bytes on the standard input, and a line
 * of 16 pulses (us) on the standard output for each frame that it accepts. Its simulator target
 * leaves this receiver out, so that only what the receiver calls is given here. */
#include <stdint.h>
#include <stdio.h>

#include "platform.h"
#define USE_SERIALRX_CRSF
#undef USE_CRSF_V3
#undef USE_CRSF_LINK_STATISTICS
#undef USE_RX_LINK_QUALITY_INFO
#undef USE_TELEMETRY_CRSF
#include "common/crc.c"
#include "common/streambuf.c"
#include "rx/crsf.c"

enum { BYTE_US = 24, PAUSE_US = 4000 };

rssiSource_e rssiSource;
static serialReceiveCallbackPtr receive;
static void *receiver;
static serialPort_t port;
static serialPortConfig_t configuration;
static uint32_t now_us;

const serialPortConfig_t *findSerialPortConfig(serialPortFunction_e function)
{
    (void)function;
    return &configuration;
}

serialPort_t *openSerialPort(serialPortIdentifier_e identifier, serialPortFunction_e function,
                             serialReceiveCallbackPtr callback, void *data, uint32_t baud,
                             portMode_e mode, portOptions_e options)
{
    (void)identifier, (void)function, (void)mode, (void)options;
    printf("%u\n", (unsigned)baud);
    receive = callback;
    receiver = data;
    return &port;
}

void serialWriteBuf(serialPort_t *instance, const uint8_t *data, int count)
{
    (void)instance, (void)data, (void)count;
}

uint32_t microsISR(void)
{
    return now_us;
}

int main(void)
{
    static rxConfig_t wanted;
    static rxRuntimeState_t state;
    wanted.midrc = 1500;
    if (!crsfRxInit(&wanted, &state)) {
        return 1;
    }
    for (int byte = getchar(); byte != EOF; byte = getchar()) {
        now_us += BYTE_US;
        receive((uint16_t)byte, receiver);
        if ((state.rcFrameStatusFn(&state) & RX_FRAME_COMPLETE) != 0) {
            for (uint8_t channel = 0; channel < state.channelCount; channel++) {
                printf("%.1f ", (double)state.rcReadRawFn(&state, channel));
            }
            printf("\n");
            now_us += PAUSE_US;
        }
    }
    return 0;
}
