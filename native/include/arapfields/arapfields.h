// SPDX-License-Identifier: GPL-3.0-or-later
// All of the C++ interface.
#pragma once

#include "arapfields/attachments.h"
#include "arapfields/curves.h"
#include "arapfields/deform.h"
#include "arapfields/device.h"
#include "arapfields/distance.h"
#include "arapfields/energies.h"
#include "arapfields/errors.h"
#include "arapfields/extraction.h"
#include "arapfields/fields.h"
#include "arapfields/io.h"
#include "arapfields/live.h"
#include "arapfields/mesh.h"
#include "arapfields/sampling.h"
#include "arapfields/sdf.h"
#include "arapfields/skin.h"
#include "arapfields/splats.h"
#include "arapfields/stylize.h"
#include "arapfields/task.h"
#include "arapfields/types.h"
#include "arapfields/wrap.h"
