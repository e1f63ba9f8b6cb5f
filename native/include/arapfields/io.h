// SPDX-License-Identifier: GPL-3.0-or-later
// Fields and signed distances as files: save_field, load_field, save_sdf, load_sdf, OutputFile; FileError.
#pragma once

#include "core/errors.h"
#include "io/files.h"
#include "io/output_file.h"
