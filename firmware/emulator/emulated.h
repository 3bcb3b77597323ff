/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * An emulated Arduino Mega 2560 and what is soldered to it. Part of taxel_boards, a program of its
 * own that links libsimavr (GPL-3.0-or-later); see README.md beside it.
 */
#ifndef EMULATED_H
#define EMULATED_H

#include <stdint.h>
#include <stdio.h>

#include "sim_avr.h"

#define HZ 16000000ULL
#define PINS 16
#define MOTORS 4

/* Bytes on their way between a pseudo-terminal and the UART. */
typedef struct {
  uint8_t *bytes;
  size_t used, room;
} queue;

typedef struct {
  int on;             /* -1 opens, 0 off, 1 closes */
  uint8_t duty;
  uint64_t since;     /* cycle of the last change of direction */
  int touching;       /* a finger that meets something */
  uint64_t touched;   /* cycle */
  double run_ma, stall_ma;
} motor;

enum i2c_fault { I2C_GOOD, I2C_SILENT, I2C_HANGS, I2C_LOW };

/* One INA226: its registers as far as the firmware uses them. */
typedef struct {
  uint8_t address, pointer, taken;
  uint16_t config, written;
  uint64_t configured; /* cycle */
} sensor;

typedef struct {
  int number;
  avr_t *avr;
  double ppm; /* how much faster than true time its resonator is */
  /* serial line */
  int port, terminal;
  queue out, in;
  int may_send;
  uint64_t sent, refused;
  FILE *tap;
  /* analog pins */
  uint16_t *wave; /* rows of 16 pins, units of 0.1 mV */
  uint64_t wave_from; /* cycle of its first row */
  size_t rows;
  uint32_t wave_hz;
  uint32_t aref_mv;
  FILE *log;
  uint64_t conversions;
  /* motors and their current sensors */
  int sensors; /* 0: none; 1: one for all motors; 4: one each */
  uint32_t shunt_mohm;
  sensor ina[MOTORS];
  motor motors[MOTORS];
  enum i2c_fault fault;
  int selected, addressing;
} emulated;

/* parts.c: analog pins */
void attach_analog(emulated *board);
/* power.c: motors, current sensors, I2C */
void attach_power(emulated *board);
void look_at_motors(emulated *board);
void hold_the_bus(emulated *board);
void sensors_lose_power(emulated *board);
/* line.c: UART and pseudo-terminal */
void attach_line(emulated *board, const char *path);
void line_in(emulated *board);
void line_out(emulated *board);

/* Microseconds of the outer world at the board's present cycle. */
static inline double outer_us(const emulated *board) {
  return (double)board->avr->cycle / 16.0 / (1.0 + board->ppm * 1e-6);
}

#endif
