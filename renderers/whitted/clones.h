/* SPDX-License-Identifier: Apache-2.0 */
/* Loops over lights are compiled for each vector width and chosen at run time. Sanitizers dislike the resolvers that
 * this needs. */
#ifndef WHITTED_CLONES_H
#define WHITTED_CLONES_H

#if defined(__x86_64__) && defined(__linux__) && defined(__OPTIMIZE__) && !defined(NO_CLONES)
#define CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define CLONES
#endif

#endif
