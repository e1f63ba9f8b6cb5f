// SPDX-License-Identifier: GPL-3.0-or-later
// What goes along with a deformed body: Attachment, rigid_motion.
#pragma once

#include "attach/attachment.h"
#include "energies/alignment.h"
