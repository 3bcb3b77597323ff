/* SPDX-License-Identifier: Apache-2.0 */
#include "hand_logic.h"

#include <string.h>

void hand_start(hand *it, const hand_config *config) {
  memset(it, 0, sizeof *it);
  it->config = config;
  it->state = TAXEL_IDLE;
  /* Nobody has read them yet: not trusted until they were good a few times. */
  for (uint8_t s = 0; s < config->sensors; s++) it->sensor[s].is_lost = 1;
}

static uint8_t is_armed(const hand *it) {
  return it->state == TAXEL_ARMED || it->state == TAXEL_MOVING;
}

static uint8_t host_is_silent(const hand *it, uint32_t now_ms) {
  return !it->heard || now_ms - it->beat_ms > it->config->watchdog_ms;
}

static uint8_t has_fault(const hand *it) {
  for (uint8_t s = 0; s < it->config->sensors; s++) {
    if (it->sensor[s].is_over || it->sensor[s].is_lost) return 1;
  }
  return 0;
}

static void turn(hand_motor *motor, int8_t on, uint32_t now_ms) {
  if (motor->on == on) return;
  motor->on = on;
  motor->since_ms = now_ms;
  motor->readings = 0;
}

static void all_off(hand *it, uint32_t now_ms) {
  it->gripping = 0;
  for (uint8_t m = 0; m < it->config->motors; m++) {
    turn(&it->motor[m], 0, now_ms);
    it->motor[m].to_ms = it->motor[m].at_ms;
  }
}

static void halt(hand *it, uint8_t state, uint32_t now_ms) {
  all_off(it, now_ms);
  it->state = state;
}

void hand_beat(hand *it, uint32_t now_ms) {
  it->heard = 1;
  it->beat_ms = now_ms;
}

static uint8_t arm(hand *it, uint32_t now_ms) {
  if (host_is_silent(it, now_ms) || has_fault(it)) return TAXEL_NOT_ARMED;
  if (is_armed(it)) return TAXEL_DONE;
  for (uint8_t m = 0; m < it->config->motors; m++) it->motor[m].contact = 0;
  it->state = TAXEL_ARMED;
  return TAXEL_DONE;
}

static int8_t way_to(int32_t to_ms, int32_t at_ms) {
  return (int8_t)((to_ms > at_ms) - (to_ms < at_ms));
}

/* Where a motor is to go. One that contact stopped goes on in that direction only for a grip that
 * allows more current than the one that stopped it. */
static void aim(hand *it, uint8_t m, const taxel_command *grip) {
  hand_motor *motor = &it->motor[m];
  int32_t to_ms = (int32_t)((uint32_t)grip->b * it->config->stroke_ms / 1000);
  uint8_t goes_home = to_ms == 0 && !(it->homed >> m & 1);
  int8_t way = goes_home ? -1 : way_to(to_ms, motor->at_ms);
  if (motor->contact && way && (way != motor->contact || grip->c > motor->touched_ma)) {
    motor->contact = 0;
  }
  if (motor->contact) {
    to_ms = motor->at_ms;
  } else if (goes_home && motor->on >= 0) {
    /* Where it stood at boot is not known: open by the whole way and a fifth more, once. */
    motor->at_ms = (int32_t)it->config->stroke_ms * 6 / 5;
  }
  motor->to_ms = to_ms;
  motor->limit_ma = grip->c;
}

static uint8_t grip(hand *it, const taxel_head *head, const taxel_command *command,
                    uint32_t now_ms) {
  uint16_t every = (uint16_t)((1U << it->config->motors) - 1);
  if (command->a == 0 || command->a > every || command->b > 1000 || command->c == 0 ||
      command->c > 0x7FFF || command->expires_ms == 0) {
    return TAXEL_BAD_ARGUMENT;
  }
  if (!is_armed(it) || host_is_silent(it, now_ms)) return TAXEL_NOT_ARMED;
  for (uint8_t m = 0; m < it->config->motors; m++) {
    if (command->a >> m & 1) aim(it, m, command);
    else it->motor[m].to_ms = it->motor[m].at_ms;
  }
  it->gripping = 1;
  it->grip_ms = now_ms;
  it->expires_ms = command->expires_ms;
  it->ran_out = (taxel_acknowledge){head->seq, head->t_us, TAXEL_EXPIRED};
  return TAXEL_DONE;
}

uint8_t hand_obey(hand *it, const taxel_head *head, const taxel_command *command,
                  uint32_t now_ms) {
  if (taxel_is_old(&it->session, head->seq, command->order)) return TAXEL_OLD;
  switch (command->order) {
    case TAXEL_IDENTIFY:
      return TAXEL_DONE;
    case TAXEL_STOP:
      halt(it, it->state == TAXEL_FAULT && has_fault(it) ? TAXEL_FAULT : TAXEL_STOPPED, now_ms);
      return TAXEL_DONE;
    case TAXEL_ARM:
      return arm(it, now_ms);
    case TAXEL_GRIP:
      return grip(it, head, command, now_ms);
    default: /* it has no scans whose rate could be set */
      return TAXEL_UNKNOWN;
  }
}

static void judge_contact(hand *it, hand_motor *motor, uint16_t ma, uint32_t now_ms) {
  if (!motor->on || now_ms - motor->since_ms < it->config->blank_ms || ma < motor->limit_ma) {
    motor->readings = 0;
    return;
  }
  if (++motor->readings < it->config->contact_readings) return;
  motor->contact = motor->on;
  motor->touched_ma = motor->limit_ma;
  turn(motor, 0, now_ms);
  motor->to_ms = motor->at_ms;
}

static void judge_sensor(hand *it, hand_sensor *sensor, uint8_t good, uint16_t ma) {
  const hand_config *config = it->config;
  if (!good) {
    sensor->good = 0;
    if (sensor->lost < config->lost_readings) sensor->lost++;
    if (sensor->lost == config->lost_readings) sensor->is_lost = 1;
    return;
  }
  sensor->lost = 0;
  if (sensor->good < config->good_readings) sensor->good++;
  if (sensor->good == config->good_readings) sensor->is_lost = 0;
  if (ma < config->over_ma) {
    sensor->over = sensor->is_over = 0;
  } else if (++sensor->over >= config->over_readings) {
    sensor->over = config->over_readings;
    sensor->is_over = 1;
  }
}

void hand_reading(hand *it, uint8_t sensor, uint8_t good, uint16_t ma, uint32_t now_ms) {
  if (good && ma > 0x7FFF) ma = 0x7FFF;
  judge_sensor(it, &it->sensor[sensor], good, ma);
  if (is_armed(it) && (it->sensor[sensor].is_over || it->sensor[sensor].is_lost)) {
    halt(it, TAXEL_FAULT, now_ms);
  }
  if (!good) return;
  for (uint8_t m = 0; m < it->config->motors; m++) {
    if (it->config->sensor_of_motor[m] != sensor) continue;
    it->motor[m].ma = (int16_t)(it->motor[m].on < 0 ? -(int16_t)ma : (int16_t)ma);
    judge_contact(it, &it->motor[m], ma, now_ms);
  }
}

static void move(hand *it, uint8_t m, uint32_t now_ms) {
  hand_motor *motor = &it->motor[m];
  motor->at_ms += motor->on;
  if (motor->on < 0 && motor->at_ms <= 0) it->homed |= (uint8_t)(1U << m);
  int8_t wanted = way_to(motor->to_ms, motor->at_ms);
  if (wanted == motor->on) return;
  if (motor->on) wanted = 0; /* there, or the other way: in either case off first */
  else if (now_ms - motor->since_ms < it->config->reverse_ms) return;
  turn(motor, wanted, now_ms);
}

uint8_t hand_tick(hand *it, uint32_t now_ms) {
  if (!is_armed(it)) return 0;
  if (host_is_silent(it, now_ms)) {
    halt(it, TAXEL_STOPPED, now_ms);
    return 0;
  }
  if (has_fault(it)) {
    halt(it, TAXEL_FAULT, now_ms);
    return 0;
  }
  if (it->gripping && now_ms - it->grip_ms >= it->expires_ms) {
    all_off(it, now_ms);
    it->state = TAXEL_ARMED;
    return 1;
  }
  uint8_t moving = 0;
  for (uint8_t m = 0; m < it->config->motors; m++) {
    if (it->gripping) move(it, m, now_ms);
    moving |= it->motor[m].on || (it->gripping && it->motor[m].to_ms != it->motor[m].at_ms);
  }
  it->state = moving ? TAXEL_MOVING : TAXEL_ARMED;
  return 0;
}
