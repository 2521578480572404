/* SPDX-License-Identifier: Apache-2.0 */
/* In a static library hidden names are seen by the host's linker too, so what files share with each other wears the
 * library's prefix there. tests/headers.sh fails where a name is missing here. */
#ifndef VCACHE_NAMES_H
#define VCACHE_NAMES_H

#define eye_cells vcache_eye_cells_
#define finite3 vcache_finite3_
#define grid_informers vcache_grid_informers_
#define grid_neighbours_of vcache_grid_neighbours_of_
#define grid_predict vcache_grid_predict_
#define grid_walk_begin vcache_grid_walk_begin_
#define grid_walk_part vcache_grid_walk_part_
#define grid_warp vcache_grid_warp_
#define grid_within vcache_grid_within_
#define kernels_avx2 vcache_kernels_avx2_
#define kernels_avx512 vcache_kernels_avx512_
#define kernels_choose vcache_kernels_choose_
#define kernels_scalar vcache_kernels_scalar_
#define light_set_place vcache_light_set_place_
#define predict_states vcache_predict_states_
#define quantize_cell vcache_quantize_cell_
#define quantize_octahedral vcache_quantize_octahedral_
#define quantize_point vcache_quantize_point_
#define quantize_power vcache_quantize_power_
#define quantize_size vcache_quantize_size_
#define quantize_step vcache_quantize_step_
#define set_walk vcache_set_walk_
#define set_write vcache_set_write_
#define table_walk vcache_table_walk_
#define table_write vcache_table_write_
#define vertex_key vcache_vertex_key_
#define vertex_step vcache_vertex_step_
#define vertices_enter vcache_vertices_enter_
#define worker_add_miss vcache_worker_add_miss_
#define worker_ask vcache_worker_ask_
#define worker_compare vcache_worker_compare_
#define worker_finish vcache_worker_finish_
#define worker_take vcache_worker_take_
#define worker_trace_one vcache_worker_trace_one_
#define worker_verify vcache_worker_verify_
#define worker_verify_one vcache_worker_verify_one_

#endif
