/* A device in C on a pseudo-terminal, with a simulated handle and hand. It prints the path
 * of its port and runs until it is ended; nothing of it is measured.
 *
 *   cargo build --release -p study-firmware-c
 *   cc -std=c99 -I firmware/c/include firmware/c/examples/pty.c \
 *      target/release/libstudy_firmware_c.a -lm -lpthread -ldl -o device-in-c
 *   ./device-in-c
 */
#define _XOPEN_SOURCE 600
#define _DEFAULT_SOURCE
#include "study_device.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define SERVO_HZ 4000.0
#define HANDLE_KG 0.25

/* Memory of the device, aligned to 8. */
static union {
    uint64_t align;
    uint8_t bytes[STUDY_DEVICE_SIZE];
} memory;

static void send_frame(void *context, const uint8_t *frame, size_t len, int32_t stream)
{
    int port = *(int *)context;
    (void)stream; /* the pseudo-terminal's queue takes all of it, or it is lost */
    if (write(port, frame, len) < 0) {
        /* nobody reads */
    }
}

/* A handle that a hand moves over the middle of the stroke while there is force. */
typedef struct Plant {
    double x_mm, v_mm_s, last_v_mm_s, force_n, phase;
} Plant;

static void plant_pass(Plant *plant, int held)
{
    const double dt = 1.0 / SERVO_HZ, middle = 17.5, half = 10.0, hz = 0.7;
    double wanted_mm, wanted_mm_s, hand_n;
    plant->last_v_mm_s = plant->v_mm_s;
    if (!held) {
        plant->v_mm_s = 0.0; /* friction holds it */
        plant->phase = 0.0;
        return;
    }
    plant->phase += 2.0 * 3.14159265358979 * hz * dt;
    wanted_mm = middle + half * sin(plant->phase);
    wanted_mm_s = half * cos(plant->phase) * 2.0 * 3.14159265358979 * hz;
    hand_n = 1.0 * (wanted_mm - plant->x_mm) + 0.02 * (wanted_mm_s - plant->v_mm_s);
    plant->v_mm_s += 1000.0 * (hand_n - plant->force_n) / HANDLE_KG * dt;
    plant->x_mm += plant->v_mm_s * dt;
}

static int open_port(void)
{
    struct termios raw;
    int port = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (port < 0 || grantpt(port) != 0 || unlockpt(port) != 0) {
        return -1;
    }
    memset(&raw, 0, sizeof raw);
    raw.c_cflag = CS8 | CREAD | CLOCAL;
    if (tcsetattr(port, TCSANOW, &raw) != 0) {
        return -1;
    }
    return port;
}

int main(void)
{
    StudySettings settings;
    Plant plant;
    struct timespec start, now;
    uint64_t periods = 0;
    int port = open_port(), line;

    if (port < 0) {
        perror("no pseudo-terminal");
        return 1;
    }
    /* Held open, so that the port does not hang up between two hosts. */
    line = open(ptsname(port), O_RDWR | O_NOCTTY);
    memset(&settings, 0, sizeof settings);
    settings.firmware = "study device in C";
    settings.serial = "in-c-1";
    settings.servo_hz = SERVO_HZ;
    settings.telemetry_hz = 1000.0;
    settings.force_n = 15.0;
    settings.velocity_mm_s = 1000.0;
    settings.stiffness_n_per_mm = 25.0;
    settings.damping_n_s_per_mm = 0.2;
    settings.stroke_from_mm = -20.0;
    settings.stroke_to_mm = 60.0;
    settings.handle_kg = HANDLE_KG;
    settings.watchdog_ms = 30;
    settings.simulated = 1;
    settings.acceleration_from_speed = 1;
    if (study_device_init(memory.bytes, sizeof memory, &settings, send_frame, &port) != 0) {
        fprintf(stderr, "the settings are not valid\n");
        return 1;
    }
    memset(&plant, 0, sizeof plant);
    plant.x_mm = 17.5;
    printf("%s\n", ptsname(port));
    fflush(stdout);

    clock_gettime(CLOCK_MONOTONIC, &start);
    for (;;) {
        double since_s;
        uint8_t bytes[256];
        ssize_t got;
        clock_gettime(CLOCK_MONOTONIC, &now);
        since_s = (double)(now.tv_sec - start.tv_sec) + 1e-9 * (double)(now.tv_nsec - start.tv_nsec);
        /* Periods that the operating system made late are run one after the other. */
        while ((double)periods < since_s * SERVO_HZ) {
            uint32_t now_ms = (uint32_t)(1000.0 * (double)periods / SERVO_HZ);
            StudyMotion motion;
            plant_pass(&plant, study_device_applies_force(memory.bytes));
            motion.x_mm = plant.x_mm;
            motion.v_mm_s = plant.v_mm_s;
            motion.a_m_s2 = (plant.v_mm_s - plant.last_v_mm_s) * SERVO_HZ * 1e-3;
            motion.force_n = 0.0;
            motion.has_force = 0;
            plant.force_n = study_device_servo(memory.bytes, &motion, now_ms);
            got = read(port, bytes, sizeof bytes);
            if (got > 0) {
                study_device_receive(memory.bytes, bytes, (size_t)got, now_ms);
                if (!study_device_applies_force(memory.bytes)) {
                    plant.force_n = 0.0;
                }
            } else if (got < 0 && errno != EAGAIN && errno != EIO) {
                close(line);
                return 0;
            }
            periods++;
        }
        now.tv_sec = 0;
        now.tv_nsec = 100000;
        nanosleep(&now, NULL);
    }
}
