// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace arapfields {

/// Threads that libtorch would use for the calling thread: what torch.set_num_threads or OMP_NUM_THREADS
/// says, else the processor's cores. Must not be asked under a SerialTorch.
int torch_threads();

/// While one lives, libtorch's functions, those of its BLAS and LAPACK included, stay on the calling thread.
/// The settings used are the thread's own (OpenMP's and MKL's thread-local ones) and come back at the end:
/// nobody else sees a change.
class SerialTorch {
 public:
  SerialTorch();
  ~SerialTorch();
  SerialTorch(const SerialTorch&) = delete;
  SerialTorch& operator=(const SerialTorch&) = delete;

 private:
  int openmp_, mkl_;
};

/// The same for the rest of the calling thread's life.
void keep_torch_serial();

}  // namespace arapfields
