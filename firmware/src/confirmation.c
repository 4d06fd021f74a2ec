// The application confirms itself to the loader (../README.md, Update).
#include "confirmation.h"

#include "../hal/flash.h"
#include "../hal/reset.h"
#include "core/memory.h"
#include "flash_layout.h"

#define CONFIRMED (APPLICATION + DESCRIPTION_CONFIRMED)
#define PATIENCE_TASKS (300000UL / CONFIRMATION_TASK_MS)

static __xdata uint16_t waited; // calls of the task

void confirmation_give(void)
{
    if (flash_read(CONFIRMED) != 0)
        flash_write(CONFIRMED, 0);
}

void confirmation_task(void)
{
    if (waited == PATIENCE_TASKS)
        return;
    waited++;
    if (waited == PATIENCE_TASKS && flash_read(CONFIRMED) != 0)
        reset_now(NOTE_NOT_GREETED);
}
