/* The device's side of study's wire format (docs/wire.md), for firmware in C or C++.
 *
 * Link with the static library of `cargo build --release -p study-device`, for a
 * Cortex-M4F with `--target thumbv7em-none-eabihf --features single`.
 *
 * The firmware calls study_device_servo() from its timer, once per servo period, applies
 * the force that it returns, and passes every received byte to study_device_receive().
 * All calls for one device come from one context or exclude each other. Nothing blocks
 * and nothing is allocated.
 *
 * F is the force that the hand has to apply, positive in the direction of +x: a motor
 * that pushes the hand towards -x has F > 0.
 */
#ifndef STUDY_DEVICE_H
#define STUDY_DEVICE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Largest number of nodes of a table. */
#define STUDY_NODES 512
/* Memory for one device, bytes, aligned to 8. study_device_size() is the exact size. */
#define STUDY_DEVICE_SIZE 45056

/* What the device is. */
typedef struct StudySettings {
    const char *firmware;          /* name and version, UTF-8, at most 32 bytes */
    const char *serial;            /* serial number, the same on every port */
    double servo_hz;               /* servo periods per second, 4000 or more */
    double telemetry_hz;           /* highest telemetry rate, samples per second */
    double force_n;                /* largest force, N; never exceeded */
    double velocity_mm_s;          /* largest velocity limit, mm/s */
    double stiffness_n_per_mm;     /* largest stiffness rendered stably, N/mm */
    double damping_n_s_per_mm;     /* largest damping rendered stably, N s/mm */
    double stroke_from_mm;         /* lowest position of the handle, mm */
    double stroke_to_mm;           /* highest position of the handle, mm */
    double handle_kg;              /* mass of the handle, kg; 0 renders no negative mass */
    uint32_t watchdog_ms;          /* limp after this time without a heartbeat, ms: 30 */
    int32_t force_sensor;          /* 1 if StudyMotion has measured forces */
    int32_t simulated;             /* 1 without a motor */
    int32_t acceleration_from_speed; /* 1 if the acceleration is (v - last v) * servo_hz */
} StudySettings;

/* Sensor values at the beginning of a servo period. */
typedef struct StudyMotion {
    double x_mm;
    double v_mm_s;
    double a_m_s2;
    double force_n;                /* measured force, N, if has_force */
    int32_t has_force;
} StudyMotion;

/* Queues a frame for the serial port, all of it or nothing, without waiting. `stream` is 1
 * for TELEMETRY and EVENT, which a full queue drops first, and 0 for a reply. */
typedef void (*StudySend)(void *context, const uint8_t *frame, size_t len, int32_t stream);

/* Bytes that a device needs. */
size_t study_device_size(void);

/* Makes a device in `memory`; 0, or -1 if memory or settings are not valid. It may need as
 * much stack as memory. */
int32_t study_device_init(void *memory, size_t size, const StudySettings *settings,
                          StudySend send, void *context);

/* Runs one servo period; returns the force to apply until the next, N. A null `motion` is
 * a measurement that failed: it trips. */
double study_device_servo(void *device, const StudyMotion *motion, uint32_t now_ms);

/* Processes bytes that the serial port received. */
void study_device_receive(void *device, const uint8_t *bytes, size_t len, uint32_t now_ms);

/* A servo period was missed; a fault only while there is force. */
void study_device_overrun(void *device, uint32_t now_ms);

/* A guard is open, a button pressed, or the drive has a fault. */
void study_device_trip(void *device, uint32_t now_ms);

/* State, docs/wire.md, chapter 5: 0 boot, 1 idle, 2 loaded, 3 ramp, 4 run, 5 stopping,
 * 6 limp, 7 fault; -1 without a device. */
int32_t study_device_state(void *device);

/* 1 if the motor may apply force. */
int32_t study_device_applies_force(void *device);

/* On a processor without an operating system the program defines this function: the motor
 * off, and no return. */
void study_device_panic(void);

#ifdef __cplusplus
}
#endif

#endif
