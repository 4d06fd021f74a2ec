// What the application does for its own update (../README.md, Update).
#include "update.h"

#include "../hal/flash.h"
#include "../hal/reset.h"
#include "flash_layout.h"
#include "memory.h"
#include "protocol.h"
#include "settings.h"
#include "transmit.h"
#include "unit.h"

#define CONFIRMED (APPLICATION + DESCRIPTION_CONFIRMED)
#define PATIENCE_TASKS (300000UL / UPDATE_TASK_MS)

static __xdata uint16_t waited; // calls of the task

uint8_t update_begin(uint32_t serial)
{
    if (serial != settings_serial())
        return RESULT_NOT_FOR_THIS_UNIT;
    if (!unit_is_at_rest())
        return RESULT_BUSY;
    transmit_then_reset(NOTE_UPDATE);
    return RESULT_DONE;
}

void update_confirm(void)
{
    if (flash_read(CONFIRMED) != 0)
        flash_write(CONFIRMED, 0);
}

void update_task(void)
{
    if (waited == PATIENCE_TASKS)
        return;
    waited++;
    if (waited == PATIENCE_TASKS && flash_read(CONFIRMED) != 0)
        reset_now(NOTE_NOT_GREETED);
}
