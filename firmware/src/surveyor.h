// The surveyor's end: a button that leads the unit along its waypoints, and an LED that says it is ready.
#ifndef SURVEYOR_H
#define SURVEYOR_H

void surveyor_start(void);

// To be called every GESTURE_SAMPLE_MS.
void surveyor_task(void);

#endif
