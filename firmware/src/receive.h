// What comes in from the host: bytes become frames, and frames whose CRC holds go to command.h.
#ifndef RECEIVE_H
#define RECEIVE_H

void receive_start(void);

void receive_task(void);

#endif
