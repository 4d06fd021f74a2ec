// The application confirms itself to the loader when a host greets it. An application that nobody greets within five
// minutes resets the chip: it may be deaf, and the loader counts its starts.
#ifndef CONFIRMATION_H
#define CONFIRMATION_H

// This application works: the loader need not count its starts any more.
void confirmation_give(void);

#define CONFIRMATION_TASK_MS 10

// To be called every CONFIRMATION_TASK_MS.
void confirmation_task(void);

#endif
