/* What is connected where: MikroKopter's flight controller (FlightCtrl ME and 2.x) and its BL-Ctrl.
 * The file to edit for another board; docs/boards/mikrokopter.md has the pins and the sources. */
#ifndef WIRING_H
#define WIRING_H

/* Lines: 115200 Bd. 20 MHz / 16 / 11 = 113636 Bd, 1.4 % slow, is the nearest that the chip can do;
 * at double speed it would be the same rate with less tolerance. */
#define UART_DIVISOR 10U

/* Converter channels, by pin of port A; all are measured against 3 V at AREF. */
#define CHANNEL_GYROSCOPE_Z 0U
#define CHANNEL_GYROSCOPE_X 1U
#define CHANNEL_GYROSCOPE_Y 2U
#define CHANNEL_PRESSURE 3U
#define CHANNEL_BATTERY 4U
#define CHANNEL_ACCELEROMETER_Z 5U
#define CHANNEL_ACCELEROMETER_Y 6U
#define CHANNEL_ACCELEROMETER_X 7U
#define CHANNELS 8U

/* 1 where a count must grow along the axes of docs/conventions.md and falls: 1023 - count is used. */
#define TURNED_ACCELEROMETER_X 0
#define TURNED_ACCELEROMETER_Y 0
#define TURNED_ACCELEROMETER_Z 0
#define TURNED_GYROSCOPE_X 0
#define TURNED_GYROSCOPE_Y 0
#define TURNED_GYROSCOPE_Z 0

/* Battery: a divider by 12.5; a count is 0.1 V times 11 / 30, here 2^-14. */
#define BATTERY_FACTOR 6007

/* Pressure: MPX4115 behind an amplifier whose zero two filtered PWM outputs move:
 * Pa = 67100 + count 1000 / 578 + 60 (fine + 1) + 120 (coarse + 1). */
#define PRESSURE_ZERO 67100
#define PRESSURE_FACTOR 28346 /* Pa a count, 2^-14 */
#define PRESSURE_FINE 60
#define PRESSURE_COARSE 120
#define PRESSURE_FINE_COUNTS 35   /* that a step of fine takes from the reading */
#define PRESSURE_COARSE_COUNTS 69
#define PRESSURE_SETTLING_MS 300U /* of the filters, 80 ms, and more */

/* Motors: BL-Ctrl's addresses on the bus: front, left, rear, right. */
#define MOTOR_ADDRESSES {0x52, 0x58, 0x54, 0x56}
#define BUS_DIVISOR 42U /* 200 kHz: 20 MHz / (16 + 2 42) */

#endif
