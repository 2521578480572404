/* SPDX-License-Identifier: Apache-2.0 */
/* What hosts of libvcache.so.0.1 and libhalton.so.0.1 were compiled against (docs/abi.md). tests/headers.sh compiles it
 * with the headers as they are: a function of another type, a constant of another value, a field elsewhere do not
 * compile; and compares the names with those the libraries export. Within a soname lines may be added, none changed or
 * removed.
 */
#include <stddef.h>
#include "halton/halton.h"
#include "vcache/adaptive.h"
#include "vcache/grid.h"
#include "vcache/save.h"

void vcache_fill_config(vcache_config *, size_t);
vcache_status vcache_create(const vcache_config *, vcache **, char *);
void vcache_destroy(vcache **);
void vcache_clear(vcache *);
const char *vcache_isa(const vcache *);
uint64_t vcache_table_words(const vcache *);
double vcache_table_filled(const vcache *, uint64_t);
float vcache_density_cone(float, float, float);
float vcache_density_pdf(float, float);
float vcache_density_unknown(const vcache *, float);
size_t vcache_eye_size(const vcache *, float);
size_t vcache_light_size(void);
vcache_light *vcache_light_at(vcache_light *, size_t);
void vcache_prepare_eye(const vcache *, const vcache_surface *, float, uint64_t, vcache_eye *);
void vcache_prepare_point(const vcache *, const float *, uint64_t, vcache_light *);
void vcache_prepare_direction(const vcache *, const float *, uint64_t, vcache_light *);
void vcache_prepare_patch(const vcache *, const vcache_surface *, vcache_light *);
void vcache_prepare_solid_angle(const vcache *, const float *, float, uint64_t, vcache_light *);
void vcache_bundle_lights(const vcache *, vcache_light *, size_t);
vcache_status vcache_light_set_create(vcache *, const vcache_light *, uint32_t, uint64_t, vcache_light_set **, char *);
void vcache_light_set_destroy(vcache_light_set **);
uint64_t vcache_light_set_rows(const vcache_light_set *);
size_t vcache_vertex_size(void);
void vcache_prepare_eye_vertex(const vcache *, const vcache_surface *, float, float, uint64_t, vcache_vertex *);
void vcache_prepare_light_vertex(const vcache *, const vcache_surface *, vcache_vertex *);
uint64_t vcache_eye_cell(const vcache_eye *, int);
void vcache_fill_worker_config(vcache_worker_config *, size_t);
vcache_status vcache_worker_create(vcache *, const vcache_worker_config *, vcache_worker **, char *);
void vcache_worker_destroy(vcache_worker **);
uint32_t vcache_add(vcache_worker *, const vcache_eye *, const vcache_light *, uint32_t, uint32_t, const uint64_t *,
                    uint64_t *);
uint32_t vcache_add_set(vcache_worker *, const vcache_eye *, vcache_light_set *, uint32_t, const uint64_t *,
                        uint64_t *);
uint32_t vcache_add_set_refining(vcache_worker *, const vcache_eye *, vcache_light_set *, uint32_t, const uint64_t *,
                                 const uint64_t *, uint64_t *);
uint32_t vcache_add_vertices(vcache_worker *, const vcache_vertex_pair *, uint32_t, uint32_t, uint64_t *);
void vcache_prefetch(vcache_worker *, const vcache_eye *, const vcache_light *);
size_t vcache_misses(vcache_worker *, const vcache_miss **);
void vcache_commit(vcache_worker *, const vcache_answer *);
void vcache_cancel(vcache_worker *);
bool vcache_resolve(vcache_worker *, vcache_trace, void *);
bool vcache_query(vcache_worker *, const vcache_eye *, const vcache_light *, uint32_t, const uint64_t *, uint64_t *,
                  vcache_trace, void *);
bool vcache_visible(vcache_worker *, const vcache_eye *, const vcache_light *, vcache_trace, void *);
void vcache_crossing(const vcache *, const vcache_eye *, const vcache_light *, uint32_t, const float *, const float *,
                     uint64_t *);
void vcache_light_set_replace(vcache_light_set *, uint32_t, const vcache_light *);
vcache_status vcache_predictor_create(vcache_light_set *, vcache_drawing, vcache_predictor **, char *);
void vcache_predictor_destroy(vcache_predictor **);
uint32_t vcache_light_set_padded(const vcache_light_set *);
vcache_prediction vcache_predict(vcache_predictor *, const vcache_surface *, float, uint64_t, const float *);
uint32_t vcache_pick_lights(const vcache_predictor *, float, uint32_t, double, vcache_pick *, uint32_t);
void vcache_learn(vcache_light_set *, const vcache_cells *, const vcache_pick *, const vcache_answer *, uint32_t);
void vcache_adapt(vcache_predictor *, const vcache_pick *, const vcache_answer *, uint32_t);
float vcache_budget_rays(vcache_budget *, float, float, uint32_t);
vcache_estimate vcache_estimate_pair(vcache_worker *, const vcache_eye *, const vcache_light *, float);
vcache_estimate vcache_estimate_vertices(vcache_worker *, const vcache_vertex *, const vcache_vertex *, float);
void vcache_learn_pair(vcache_worker *, const vcache_estimate *, vcache_answer);
void vcache_worker_statistics(const vcache_worker *, vcache_statistics *);
void vcache_worker_reset_statistics(vcache_worker *);
const char *vcache_status_text(vcache_status);
uint32_t vcache_version(void);
void vcache_adaptive_fill_config(vcache_adaptive_config *, size_t);
vcache_status vcache_adaptive_create(const vcache_adaptive_config *, vcache_adaptive **, char *);
void vcache_adaptive_destroy(vcache_adaptive **);
vcache_status vcache_adaptive_worker_create(vcache_adaptive *, vcache_adaptive_worker **, char *);
vcache_status vcache_adaptive_worker_create_beside(vcache_adaptive_worker *, vcache_adaptive_worker **, char *);
void vcache_adaptive_worker_destroy(vcache_adaptive_worker **);
void vcache_adaptive_begin(vcache_adaptive_worker *, const float *, float *, float);
uint32_t vcache_adaptive_next(vcache_adaptive_worker *, uint32_t *, uint32_t);
void vcache_adaptive_tell(vcache_adaptive_worker *, const vcache_answer *);
uint32_t vcache_adaptive_finish(vcache_adaptive_worker *);
void vcache_adaptive_merge(vcache_adaptive *, vcache_adaptive_worker *const *, uint32_t);
vcache_adaptive_source vcache_adaptive_source_rate(const vcache_adaptive *, uint32_t);
void vcache_adaptive_worker_statistics(const vcache_adaptive_worker *, vcache_adaptive_statistics *);
void vcache_adaptive_worker_reset_statistics(vcache_adaptive_worker *);
vcache_status vcache_grid_create_lights(const float *, const float *, uint32_t, const vcache_allocator *,
                                        vcache_grid_lights **, char *);
void vcache_grid_destroy_lights(vcache_grid_lights **);
const uint64_t *vcache_grid_neighbours(const vcache_grid_lights *, uint32_t);
uint32_t vcache_grid_words(const vcache_grid_lights *);
uint32_t vcache_grid_nearest(const vcache_grid_lights *, const float *);
void vcache_grid_fill_config(vcache_grid_config *, size_t);
bool vcache_grid_parse_mode(const char *, vcache_grid_config *, char *);
const char *const *vcache_grid_mode_names(void);
vcache_status vcache_grid_create(const vcache_grid_config *, const vcache_grid_lights *, vcache_grid **, char *);
void vcache_grid_destroy(vcache_grid **);
size_t vcache_grid_bytes(const vcache_grid *);
void vcache_grid_begin(vcache_grid *, uint32_t, uint32_t);
uint64_t *vcache_grid_pixel(vcache_grid *, uint32_t, uint32_t, uint64_t, const float *);
const vcache_grid_ray *vcache_grid_next(vcache_grid *, uint32_t *);
void vcache_grid_tell(vcache_grid *, const vcache_answer *, const float *);
const uint64_t *vcache_grid_visible(const vcache_grid *, uint32_t, uint32_t);
void vcache_grid_statistics_of(const vcache_grid *, vcache_grid_statistics *);
void vcache_grid_reset_statistics(vcache_grid *);
vcache_status vcache_save(const vcache *, uint64_t, vcache_write, void *, char *);
vcache_status vcache_load(const vcache_config *, uint64_t, vcache_read, void *, vcache **, char *);
vcache_status vcache_light_set_save(const vcache_light_set *, uint64_t, vcache_write, void *, char *);
vcache_status vcache_light_set_load(vcache *, const vcache_light *, uint32_t, uint64_t, uint64_t, vcache_read, void *,
                                    vcache_light_set **, char *);
const char *halton_status_text(halton_status);
halton_status halton_segments(uint32_t, double, uint32_t *, uint32_t *);
halton_status halton_order(uint32_t, uint32_t, double, uint32_t *, uint32_t *, uint32_t *);
halton_status halton_tile_order(uint32_t, uint32_t, halton_tile, const uint32_t *, uint32_t *);
uint64_t halton_morton(uint32_t, uint32_t);
void halton_morton_decode(uint64_t, uint32_t *, uint32_t *);
uint64_t halton_reverse2(uint64_t, unsigned int);
uint64_t halton_reverse3(uint64_t, unsigned int);
double halton_radical_inverse2(uint64_t);
double halton_radical_inverse3(uint64_t);

/* clang-format off */
#define IS(constant, value) _Static_assert((constant) == (value), #constant);
IS(VCACHE_OK, 0) IS(VCACHE_ERROR_ARGUMENT, 1) IS(VCACHE_ERROR_MEMORY, 2) IS(VCACHE_ERROR_FILE, 3)
IS(VCACHE_HASH_SPLIT, 0) IS(VCACHE_HASH_LCG_PAIR, 1) IS(VCACHE_HASH_LCG_XORSHIFT, 2) IS(VCACHE_DRAW_UNCERTAIN, 0)
IS(VCACHE_DRAW_VISIBLE, 1) IS(VCACHE_DRAW_BRIGHT, 2) IS(VCACHE_GRID_TRUE, 0) IS(VCACHE_GRID_EYE, 1)
IS(VCACHE_GRID_SCANLINE, 2) IS(VCACHE_GRID_GRID, 3) IS(HALTON_OK, 0) IS(HALTON_ERROR_NULL, 1)
IS(HALTON_ERROR_SIZE, 2) IS(HALTON_ERROR_CE, 3) IS(VCACHE_MESSAGE_BYTES, 160) IS(VCACHE_EYE_BYTES, 1024)
IS(VCACHE_LIGHT_BYTES, 96) IS(VCACHE_VERTEX_BYTES, 96) IS(VCACHE_MAX_LEVELS, 16) IS(VCACHE_MAX_SET, 65536)
IS(VCACHE_CELLS, 3) IS(VCACHE_ISA_SCALAR, 0u) IS(VCACHE_ISA_AVX2, 1u) IS(VCACHE_ISA_AVX512, 2u)
IS(VCACHE_ISA_ALL, 0xffffffffu) IS(VCACHE_BLOCKED, 0) IS(VCACHE_VISIBLE, 1) IS(VCACHE_ONCE, 2)
IS(VCACHE_ADAPTIVE_MAX_SOURCES, 16777216) IS(VCACHE_GRID_MAX_LIGHTS, 16384) IS(HALTON_MAX_SEGMENTS, 18)

#if UINTPTR_MAX == UINT64_MAX
#define AT(type, field, offset, bytes) _Static_assert(offsetof(type, field) == (offset) && \
    sizeof((type){0}.field) == (bytes), #type "." #field);
#define SIZE(type, bytes) _Static_assert(sizeof(type) == (bytes), #type);
#define GROWS(type, bytes) _Static_assert(sizeof(type) >= (bytes), #type);

SIZE(vcache_allocator, 24) AT(vcache_allocator, allocate, 0, 8) AT(vcache_allocator, release, 8, 8)
    AT(vcache_allocator, context, 16, 8)
GROWS(vcache_config, 88) AT(vcache_config, size, 0, 8) AT(vcache_config, bounds_min, 8, 12)
    AT(vcache_config, bounds_max, 20, 12) AT(vcache_config, normal_bins, 32, 4) AT(vcache_config, layers, 36, 4)
    AT(vcache_config, resolution_step, 40, 4) AT(vcache_config, levels, 44, 4) AT(vcache_config, table_bytes, 48, 8)
    AT(vcache_config, hash, 56, 4) AT(vcache_config, isa, 60, 4) AT(vcache_config, allocator, 64, 24)
SIZE(vcache_surface, 40) AT(vcache_surface, position, 0, 12) AT(vcache_surface, normal, 12, 12)
    AT(vcache_surface, density, 24, 4) AT(vcache_surface, user, 32, 8)
SIZE(vcache_miss, 48) AT(vcache_miss, eye_user, 0, 8) AT(vcache_miss, light_user, 8, 8)
    AT(vcache_miss, eye_position, 16, 12) AT(vcache_miss, light_position, 28, 12) AT(vcache_miss, infinite, 40, 1)
SIZE(vcache_misprediction, 64) AT(vcache_misprediction, ray, 0, 48) AT(vcache_misprediction, visible, 48, 1)
    AT(vcache_misprediction, level, 52, 4) AT(vcache_misprediction, cell, 56, 8)
GROWS(vcache_worker_config, 32) AT(vcache_worker_config, size, 0, 8) AT(vcache_worker_config, capacity, 8, 4)
    AT(vcache_worker_config, exact, 12, 1) AT(vcache_worker_config, verify, 13, 1)
    AT(vcache_worker_config, report, 16, 8) AT(vcache_worker_config, report_context, 24, 8)
SIZE(vcache_vertex_pair, 16) AT(vcache_vertex_pair, eye, 0, 8) AT(vcache_vertex_pair, light, 8, 8)
SIZE(vcache_cells, 24) AT(vcache_cells, key, 0, 24)
SIZE(vcache_prediction, 40) AT(vcache_prediction, mean, 0, 8) AT(vcache_prediction, expected, 8, 4)
    AT(vcache_prediction, deviation, 12, 4) AT(vcache_prediction, cells, 16, 24)
SIZE(vcache_pick, 16) AT(vcache_pick, light, 0, 4) AT(vcache_pick, sample, 4, 4) AT(vcache_pick, state, 8, 4)
    AT(vcache_pick, weight, 12, 4)
SIZE(vcache_budget, 40) AT(vcache_budget, rays, 0, 4) AT(vcache_budget, sum, 8, 8) AT(vcache_budget, values, 16, 8)
    AT(vcache_budget, count, 24, 8) AT(vcache_budget, scale, 32, 8)
SIZE(vcache_estimate, 16) AT(vcache_estimate, mean, 0, 4) AT(vcache_estimate, probability, 4, 4)
    AT(vcache_estimate, key, 8, 8)
GROWS(vcache_statistics, 216) AT(vcache_statistics, size, 0, 8) AT(vcache_statistics, asked, 8, 8)
    AT(vcache_statistics, traced, 16, 8) AT(vcache_statistics, bypassed, 24, 8) AT(vcache_statistics, once, 32, 8)
    AT(vcache_statistics, stored, 40, 8) AT(vcache_statistics, overwritten, 48, 8)
    AT(vcache_statistics, hits, 56, 128) AT(vcache_statistics, hit_levels, 184, 4)
    AT(vcache_statistics, verified, 192, 8) AT(vcache_statistics, mispredicted, 200, 8)
    AT(vcache_statistics, leaked, 208, 8)
GROWS(vcache_adaptive_config, 56) AT(vcache_adaptive_config, size, 0, 8) AT(vcache_adaptive_config, sources, 8, 4)
    AT(vcache_adaptive_config, tolerance, 12, 4) AT(vcache_adaptive_config, certainty, 16, 4)
    AT(vcache_adaptive_config, prior_hits, 20, 4) AT(vcache_adaptive_config, prior_tests, 24, 4)
    AT(vcache_adaptive_config, free_running, 28, 1) AT(vcache_adaptive_config, allocator, 32, 24)
SIZE(vcache_adaptive_source, 24) AT(vcache_adaptive_source, tests, 0, 8) AT(vcache_adaptive_source, hits, 8, 8)
    AT(vcache_adaptive_source, rate, 16, 4)
GROWS(vcache_adaptive_statistics, 48) AT(vcache_adaptive_statistics, size, 0, 8)
    AT(vcache_adaptive_statistics, points, 8, 8) AT(vcache_adaptive_statistics, candidates, 16, 8)
    AT(vcache_adaptive_statistics, tested, 24, 8) AT(vcache_adaptive_statistics, visible, 32, 8)
    AT(vcache_adaptive_statistics, compared, 40, 8)
GROWS(vcache_grid_config, 72) AT(vcache_grid_config, size, 0, 8) AT(vcache_grid_config, pixels, 8, 4)
    AT(vcache_grid_config, order, 12, 4) AT(vcache_grid_config, warping, 16, 1)
    AT(vcache_grid_config, boundary, 17, 1) AT(vcache_grid_config, restricted, 18, 1)
    AT(vcache_grid_config, flood, 20, 4) AT(vcache_grid_config, near, 24, 4) AT(vcache_grid_config, rounds, 28, 4)
    AT(vcache_grid_config, bright, 32, 4) AT(vcache_grid_config, spacing, 36, 4)
    AT(vcache_grid_config, threshold, 40, 4) AT(vcache_grid_config, rays, 44, 4)
    AT(vcache_grid_config, allocator, 48, 24)
SIZE(vcache_grid_ray, 8) AT(vcache_grid_ray, pixel, 0, 4) AT(vcache_grid_ray, light, 4, 4)
GROWS(vcache_grid_statistics, 80) AT(vcache_grid_statistics, size, 0, 8) AT(vcache_grid_statistics, pixels, 8, 8)
    AT(vcache_grid_statistics, asked, 16, 8) AT(vcache_grid_statistics, traced, 24, 8)
    AT(vcache_grid_statistics, coarse, 32, 8) AT(vcache_grid_statistics, silhouette, 40, 8)
    AT(vcache_grid_statistics, uncertain, 48, 8) AT(vcache_grid_statistics, flooded, 56, 8)
    AT(vcache_grid_statistics, surprises, 64, 8) AT(vcache_grid_statistics, batches, 72, 8)
SIZE(halton_tile, 16) AT(halton_tile, x, 0, 4) AT(halton_tile, y, 4, 4) AT(halton_tile, width, 8, 4)
    AT(halton_tile, height, 12, 4)
#endif
    /* clang-format on */
