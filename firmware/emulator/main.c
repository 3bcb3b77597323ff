/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * taxel_boards: run real firmware on emulated Arduino Mega 2560 boards, in virtual or real time.
 *
 *   taxel_boards [--live] --board key=value,… [--board …]
 *
 *     elf=FILE       the firmware
 *     port=PATH      a link to the pseudo-terminal of its serial line
 *     wave=FILE      u16 rows of 16 pins, tenths of a millivolt, little-endian; the last row stays
 *     hz=N           rows a second
 *     aref=MV        the voltage on the AREF pin (3300)
 *     log=FILE       every conversion, 16 bytes each
 *     tap=FILE       every byte that the board sent
 *     sensors=N      INA226 on I2C: 0, 1 for all motors, 4 for one each
 *     shunt=MOHM     their shunts (10)
 *     boots=N        what the EEPROM's count of boots begins with
 *     ppm=N          how much faster than true time its resonator is
 *
 * Commands on stdin, one a line: "run US" (then answered "done …"), "contact BOARD MOTOR 0|1",
 * "wave BOARD FILE" (another waveform from this moment on), "load BOARD MOTOR RUN_MA STALL_MA",
 * "i2c BOARD good|silent|hangs|low", "power BOARD" (the current sensors lose and regain it), "reset BOARD", "hang BOARD 0|1" (the program counter jumps into an
 * endless loop; 1: with interrupts off), "quit". Events on stdout: "event BOARD US what …".
 * With --live time passes as outside, without "run". All boards advance together, 0.5 ms at a time.
 *
 * It links libsimavr (GPL-3.0-or-later) and is a program of its own: nothing of taxel links it.
 */
#include <poll.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "avr_eeprom.h"
#include "emulated.h"
#include "sim_elf.h"

#define SLICE_US 500
#define MOST_BOARDS 16

static emulated boards[MOST_BOARDS];
static int count;
static uint64_t now_us;

static void fail(const char *what, const char *name) {
  fprintf(stderr, "taxel_boards: %s: %s\n", what, name);
  exit(2);
}

static void quiet(avr_t *avr, const int level, const char *format, va_list rest) {
  (void)avr;
  if (level <= LOG_ERROR) vfprintf(stderr, format, rest);
}

static void sleep_at_once(avr_t *avr, avr_cycle_count_t cycles) { (void)avr, (void)cycles; }

static FILE *opened(const char *path, const char *mode) {
  FILE *file = fopen(path, mode);
  if (!file) fail("cannot open", path);
  return file;
}

static void load_wave(emulated *board, const char *path) {
  FILE *file = opened(path, "rb");
  struct stat about;
  if (fstat(fileno(file), &about)) fail("cannot read", path);
  size_t size = (size_t)about.st_size;
  uint16_t *wave = malloc(size ? size : 1);
  if (!wave || fread(wave, 1, size, file) != size) fail("cannot read", path);
  fclose(file);
  free(board->wave);
  board->wave = wave;
  board->wave_from = board->avr->cycle;
  board->rows = size / (PINS * sizeof *wave);
}

static void make_board(char *text) {
  emulated *board = &boards[count];
  char *elf = NULL, *port = NULL, *wave = NULL;
  uint32_t boots = 0xFFFFFFFF;
  *board = (emulated){.number = count, .wave_hz = 1000, .aref_mv = 3300, .shunt_mohm = 10};
  if (count++ == MOST_BOARDS) fail("too many boards", text);
  for (char *part = strtok(text, ","); part; part = strtok(NULL, ",")) {
    char *value = strchr(part, '=');
    if (!value) fail("no value", part);
    *value++ = 0;
    if (!strcmp(part, "elf")) elf = value;
    else if (!strcmp(part, "port")) port = value;
    else if (!strcmp(part, "wave")) wave = value;
    else if (!strcmp(part, "hz")) board->wave_hz = (uint32_t)atol(value);
    else if (!strcmp(part, "aref")) board->aref_mv = (uint32_t)atol(value);
    else if (!strcmp(part, "log")) board->log = opened(value, "wb");
    else if (!strcmp(part, "tap")) board->tap = opened(value, "wb");
    else if (!strcmp(part, "sensors")) board->sensors = atoi(value);
    else if (!strcmp(part, "shunt")) board->shunt_mohm = (uint32_t)atol(value);
    else if (!strcmp(part, "boots")) boots = (uint32_t)atoll(value);
    else if (!strcmp(part, "ppm")) board->ppm = atof(value);
    else fail("no such key", part);
  }
  elf_firmware_t firmware;
  memset(&firmware, 0, sizeof firmware);
  if (!elf || elf_read_firmware(elf, &firmware)) fail("cannot load", elf ? elf : "nothing");
  board->avr = avr_make_mcu_by_name("atmega2560");
  if (!board->avr) fail("libsimavr lacks", "atmega2560");
  avr_init(board->avr);
  board->avr->frequency = HZ;
  board->avr->sleep = sleep_at_once;
  avr_load_firmware(board->avr, &firmware);
  board->avr->frequency = HZ;
  avr_eeprom_desc_t memory = {.ee = (uint8_t *)&boots, .offset = 0, .size = sizeof boots};
  avr_ioctl(board->avr, AVR_IOCTL_EEPROM_SET, &memory);
  if (wave) load_wave(board, wave);
  attach_analog(board);
  attach_power(board);
  attach_line(board, port);
}

static void advance(emulated *board, uint64_t until_us) {
  avr_t *avr = board->avr;
  uint64_t until = (uint64_t)((double)until_us * 16.0 * (1.0 + board->ppm * 1e-6));
  line_in(board);
  /* Instructions between looks: one where motors are watched, else as many as fit. */
  avr->run_cycle_limit = board->sensors ? 1 : 200;
  while (avr->cycle < until) {
    int state = avr_run(avr);
    if (state == cpu_Done || state == cpu_Crashed) fail("the firmware crashed", "see above");
    if (board->sensors) {
      hold_the_bus(board);
      look_at_motors(board);
    }
  }
  line_out(board);
}

static void run(uint64_t us) {
  uint64_t until = now_us + us;
  while (now_us < until) {
    now_us = until - now_us > SLICE_US ? now_us + SLICE_US : until;
    for (int b = 0; b < count; b++) advance(&boards[b], now_us);
  }
  for (int b = 0; b < count; b++) line_out(&boards[b]);
}

static void reset(emulated *board) {
  board->in.used = 0;
  avr_reset(board->avr);
  if (board->sensors) look_at_motors(board);
}

static void hang(emulated *board, int interrupts_off) {
  /* The end of every program of avr-libc: cli, then a jump to itself. */
  const uint8_t *flash = board->avr->flash;
  for (uint32_t at = 0; at + 3 < board->avr->codeend; at += 2) {
    if (flash[at] == 0xF8 && flash[at + 1] == 0x94 && flash[at + 2] == 0xFF &&
        flash[at + 3] == 0xCF) {
      board->avr->pc = at + (interrupts_off ? 0 : 2);
      if (!interrupts_off) board->avr->sreg[S_I] = 1;
      board->avr->state = cpu_Running;
      return;
    }
  }
  fail("no endless loop in", "the firmware");
}

static void set_fault(emulated *board, const char *name) {
  static const char *names[] = {"good", "silent", "hangs", "low"};
  for (int i = 0; i < 4; i++) {
    if (!strcmp(name, names[i])) board->fault = (enum i2c_fault)i;
  }
}

static void obey(char *line) {
  int b = 0, m = 0;
  double x = 0, y = 0;
  char word[16] = "", path[200] = "";
  unsigned long long us;
  if (sscanf(line, "run %llu", &us) == 1) {
    run(us);
    printf("done %llu", (unsigned long long)now_us);
    for (int i = 0; i < count; i++) {
      printf(" %llu %llu", (unsigned long long)boards[i].sent,
             (unsigned long long)(boards[i].out.used + boards[i].refused));
    }
    printf("\n");
    for (int i = 0; i < count; i++) {
      if (boards[i].log) fflush(boards[i].log);
      if (boards[i].tap) fflush(boards[i].tap);
    }
    return;
  }
  if (!strncmp(line, "quit", 4)) exit(0);
  if (sscanf(line, "%*s %d", &b) != 1 || b < 0 || b >= count) fail("cannot obey", line);
  emulated *board = &boards[b];
  if (sscanf(line, "contact %d %d %lf", &b, &m, &x) == 3 && m >= 0 && m < MOTORS) {
    board->motors[m].touching = x != 0;
    board->motors[m].touched = board->avr->cycle;
    printf("event %d %.3f contact %d %d\n", b, outer_us(board), m, x != 0);
  } else if (sscanf(line, "wave %d %199s", &b, path) == 2) {
    load_wave(board, path);
  } else if (sscanf(line, "load %d %d %lf %lf", &b, &m, &x, &y) == 4 && m >= 0 && m < MOTORS) {
    board->motors[m].run_ma = x;
    board->motors[m].stall_ma = y;
  } else if (sscanf(line, "i2c %d %15s", &b, word) == 2) {
    set_fault(board, word);
    printf("event %d %.3f i2c %s\n", b, outer_us(board), word);
  } else if (!strncmp(line, "power", 5)) {
    sensors_lose_power(board);
    printf("event %d %.3f power\n", b, outer_us(board));
  } else if (!strncmp(line, "reset", 5)) {
    reset(board);
  } else if (sscanf(line, "hang %d %lf", &b, &x) == 2) {
    printf("event %d %.3f hang\n", b, outer_us(board));
    hang(board, x != 0);
  } else {
    fail("cannot obey", line);
  }
}

static uint64_t outside_us(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (uint64_t)now.tv_sec * 1000000 + (uint64_t)now.tv_nsec / 1000;
}

static void live(void) {
  char line[256];
  uint64_t began = outside_us();
  for (;;) {
    struct pollfd in = {.fd = 0, .events = POLLIN};
    uint64_t due = began + now_us + SLICE_US, at = outside_us();
    int wait_ms = due > at ? (int)((due - at) / 1000) : 0;
    if (poll(&in, 1, wait_ms) > 0) {
      if (!fgets(line, sizeof line, stdin)) exit(0);
      obey(line);
    }
    at = outside_us() - began;
    if (at > now_us) run(at - now_us);
    else usleep(200);
    fflush(stdout);
  }
}

int main(int argc, char **argv) {
  int real_time = 0;
  char line[256];
  avr_global_logger_set(quiet);
  for (int i = 1; i < argc; i++) {
    if (!strcmp(argv[i], "--live")) real_time = 1;
    else if (!strcmp(argv[i], "--board") && i + 1 < argc) make_board(argv[++i]);
    else fail("unknown argument", argv[i]);
  }
  if (!count) fail("needed", "--board elf=FILE");
  setvbuf(stdin, NULL, _IONBF, 0); /* poll() must see every line */
  printf("ready %d\n", count);
  fflush(stdout);
  if (real_time) live();
  while (fgets(line, sizeof line, stdin)) {
    obey(line);
    fflush(stdout);
  }
  return 0;
}
