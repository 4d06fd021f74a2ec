// The command UPDATE (../README.md, Update): gives way to the loader.
#include "update.h"

#include "../hal/reset.h"
#include "core/protocol.h"
#include "settings.h"
#include "transmit.h"
#include "unit.h"

uint8_t update_begin(uint32_t serial)
{
    if (serial != settings_serial())
        return RESULT_NOT_FOR_THIS_UNIT;
    if (!unit_is_at_rest())
        return RESULT_BUSY;
    transmit_then_reset(NOTE_UPDATE);
    return RESULT_DONE;
}
