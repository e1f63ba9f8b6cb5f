// SPDX-License-Identifier: GPL-3.0-or-later
// A library of Windows that Wine 8 lacks, as far as safetensors, an oracle of the tests, asks for it: random bytes.
#include <stddef.h>
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(PVOID buffer, ULONG bytes);

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE buffer, SIZE_T bytes) {
  while (bytes > 0) {
    const ULONG part = bytes < (1u << 20) ? (ULONG)bytes : 1u << 20;
    if (!SystemFunction036(buffer, part)) return FALSE;
    buffer += part;
    bytes -= part;
  }
  return TRUE;
}
