// SPDX-License-Identifier: GPL-3.0-or-later
// The threads of the library that does our products; defined by the tensors' backend.
#pragma once

namespace arapfields {

/// Threads for the calling thread's loops where nothing else is said: OMP_NUM_THREADS or what the
/// library was told, else the processor's cores. Must not be called under a SerialLibrary.
int library_threads();

/// While one lives, the library's functions, those of its BLAS and LAPACK included, stay on the calling
/// thread. The settings used are the thread's own (OpenMP's and MKL's thread-local ones) and come back at the
/// end: nobody else sees a change.
class SerialLibrary {
 public:
  SerialLibrary();
  ~SerialLibrary();
  SerialLibrary(const SerialLibrary&) = delete;
  SerialLibrary& operator=(const SerialLibrary&) = delete;

 private:
  int openmp_, mkl_;
};

/// The same for the rest of the calling thread's life.
void keep_library_serial();

}  // namespace arapfields
