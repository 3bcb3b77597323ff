/* SPDX-License-Identifier: Apache-2.0
 *
 * When the hand's motors may run: the board's half of the interlock, in plain C.
 *
 *     from            when                                                to       motors
 *     IDLE, STOPPED,
 *     FAULT           arm, and no cause persists                          ARMED    off
 *     ARMED, MOVING   grip                                                MOVING   those that it names
 *     MOVING          every motor is there, in contact, or time is out    ARMED    off
 *     MOVING          one motor is there or in contact                    MOVING   that one off
 *     ARMED, MOVING   no heartbeat of the host for watchdog_ms            STOPPED  off
 *     ARMED, MOVING   over-current; a current sensor that fails           FAULT    off
 *     any but FAULT   stop                                                STOPPED  off
 *     FAULT           stop, and the fault is gone                         STOPPED  off
 *     any             anything else                                       same     same
 *
 * As in Python's interlock (src/taxel/actions/interlock.py): motion needs a person's arm, a
 * silent partner or a sensor that fails stops it, what has stopped stays so until it is armed again,
 * arming is refused while a cause persists, and every order runs out unless it is refreshed. Where
 * that one stops everything on contact, this one, nearer to the motors, stops the one finger and
 * stays armed, so that the others can go on; the host's interlock stands behind it.
 *
 * Times are the caller's milliseconds, which may wrap. Nothing blocks. Knows nothing about registers, I2C
 * or frames. Source of limits: docs/decisions/0020.
 */
#ifndef HAND_LOGIC_H
#define HAND_LOGIC_H

#include "taxel_message.h"

#ifdef __cplusplus
extern "C" {
#endif

#define HAND_MOST 8 /* motors */

typedef struct {
  uint8_t motors;
  const uint8_t *sensor_of_motor;
  uint8_t sensors;
  uint16_t over_ma;         /* a current that stops everything */
  uint16_t stroke_ms;       /* from open to closed */
  uint16_t blank_ms;        /* after a start in which no current means contact */
  uint16_t watchdog_ms;     /* without a heartbeat of the host */
  uint16_t reverse_ms;      /* a motor rests between two directions */
  uint8_t contact_readings; /* in a row at or above a grip's current are a contact */
  uint8_t over_readings;    /* in a row at or above over_ma are a fault */
  uint8_t lost_readings;    /* in a row that fail are a fault */
  uint8_t good_readings;    /* in a row until a sensor is trusted again */
} hand_config;

/* One reading more or less of a sensor. */
typedef struct {
  uint8_t over, lost, good;
  uint8_t is_over, is_lost;
} hand_sensor;

typedef struct {
  int8_t on;          /* -1 opens, 0 off, 1 closes: what the driver is to do now */
  int8_t contact;     /* the direction in which something stopped it: no further, unless harder */
  uint8_t readings;   /* in a row that look like contact */
  uint16_t limit_ma;  /* of the grip under way */
  uint16_t touched_ma; /* the limit at which contact stopped it */
  int32_t at_ms;      /* where it is, in milliseconds of travel; 0 is open */
  int32_t to_ms;      /* where it goes */
  uint32_t since_ms;  /* when it was switched on or off last */
  int16_t ma;         /* newest reading, negative while it opens */
} hand_motor;

typedef struct {
  const hand_config *config;
  uint8_t state; /* enum taxel_state */
  taxel_session session;
  uint8_t heard; /* a heartbeat came since boot */
  uint8_t homed; /* bit a motor: it has been all the way open since boot */
  uint32_t beat_ms;
  uint8_t gripping; /* a grip is under way, until: */
  uint32_t grip_ms;
  uint16_t expires_ms;
  taxel_acknowledge ran_out; /* what to acknowledge when it runs out */
  hand_motor motor[HAND_MOST];
  hand_sensor sensor[HAND_MOST];
} hand;

void hand_start(hand *it, const hand_config *config);

/* A heartbeat of the host. */
void hand_beat(hand *it, uint32_t now_ms);

/* A command for this board; returns the result. An identify's hello is the caller's. */
uint8_t hand_obey(hand *it, const taxel_head *head, const taxel_command *command,
                  uint32_t now_ms);

/* A reading of a sensor: its current's size, mA, or that it could not be read (good 0). */
void hand_reading(hand *it, uint8_t sensor, uint8_t good, uint16_t ma, uint32_t now_ms);

/* Once a millisecond. Returns 1 where a grip ran out: it->ran_out must be sent. */
uint8_t hand_tick(hand *it, uint32_t now_ms);

#ifdef __cplusplus
}
#endif
#endif
