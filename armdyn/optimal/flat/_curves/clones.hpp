// One binary for every x86-64: the loops that take the time are compiled for its newer instructions, too.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define ARMDYN_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define ARMDYN_CLONES
#endif
