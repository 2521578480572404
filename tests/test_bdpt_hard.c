/* SPDX-License-Identifier: Apache-2.0 */
/* Numerical hard cases of bidirectional path tracing with cached and estimated connections: noisy, far, thin,
 * degenerate scenes, extreme settings. Images of one seed have the same paths in each mode, so that their
 * difference is that of visibility alone; where means are compared over seeds, they lie within 3 standard errors. */
#include "bdpt_support.h"

/* Share of pixels that are not the same bit for bit. */
static double different(const image *a, const image *b)
{
    size_t count = (size_t)a->width * a->height, n = 0;
    for (size_t i = 0; i < count; i++)
        n += memcmp(&a->pixels[i], &b->pixels[i], sizeof(rgb)) != 0;
    return (double)n / (double)count;
}

/* ------------------------------------------------------------------------------------------------------- noise */

/* A parallelogram of n x n quads; corners and shading normals are off by `noise` at random. */
static void add_noisy_wall(scene *s, rng *r, vec3 a, vec3 ab, vec3 ac, int n, float noise, uint32_t material_index)
{
    uint32_t across = (uint32_t)n + 1, count = across * across;
    mesh m = {.vertex_count = count, .triangle_count = 2 * (uint32_t)(n * n), .material = material_index};
    m.positions = xmalloc(3 * count * sizeof(float));
    m.normals = xmalloc(3 * count * sizeof(float));
    m.indices = xmalloc(3 * (size_t)m.triangle_count * sizeof(uint32_t));
    vec3 normal = v3_normalize(v3_cross(ab, ac));
    for (uint32_t i = 0; i < count; i++) {
        vec3 p = v3_mad(v3_mad(a, (float)(i % across) / (float)n, ab), (float)(i / across) / (float)n, ac);
        p = v3_add(p, random_vec3(r, noise));
        vec3 k = v3_add(normal, random_vec3(r, noise));
        memcpy(m.positions + 3 * i, &p, 3 * sizeof(float));
        memcpy(m.normals + 3 * i, &k, 3 * sizeof(float));
    }
    uint32_t *to = m.indices;
    for (uint32_t j = 0; j < (uint32_t)n; j++)
        for (uint32_t i = 0; i < (uint32_t)n; i++, to += 6) {
            uint32_t at = j * across + i;
            const uint32_t quad[6] = {at, at + 1, at + across + 1, at, at + across + 1, at + across};
            memcpy(to, quad, sizeof quad);
        }
    place_mesh(s, scene_add_mesh(s, m), transform_identity);
}

/* A floor and walls at round coordinates, a shelf through the middle of the bounds, a lamp below and one above it. */
static stage noisy_room(float noise, float angle)
{
    scene *s = scene_new("noise");
    rng r = rng_make(11, 1);
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[lamp].emission = v3(5, 5, 5);
    add_noisy_wall(s, &r, v3(-2, -2, -2), v3(0, 0, 4), v3(4, 0, 0), 16, noise, grey);
    add_noisy_wall(s, &r, v3(-2, 2, -2), v3(4, 0, 0), v3(0, 0, 4), 16, noise, grey);
    add_noisy_wall(s, &r, v3(-2, -2, -2), v3(4, 0, 0), v3(0, 4, 0), 16, noise, grey);
    add_noisy_wall(s, &r, v3(-2, -2, -2), v3(0, 4, 0), v3(0, 0, 4), 16, noise, grey);
    add_noisy_wall(s, &r, v3(-2, 0, -2), v3(0, 0, 4), v3(2, 0, 0), 16, noise, grey);
    add_quad(s, v3(0.5f, 1.9f, -0.5f), v3(1, 0, 0), v3(0, 0, 1), lamp);
    add_quad(s, v3(-1.0f, -0.5f, -0.5f), v3(0.5f, 0, 0), v3(0, 0, 0.5f), lamp);
    add_quad(s, v3(2, -2, 2), v3(0, 0.01f, 0), v3(0, 0, -0.01f), grey); /* bounds are a cube around the origin */
    camera c = camera_look(v3(1.6f, 0.6f, 5.0f), v3(-0.3f, -0.1f, 0), v3(0, 1, 0), 0.9f);
    float m[12];
    motion(angle, v3(0, 0, 0), m);
    move_scene(s, &c, m);
    return cached_stage(s, c, 96, 72, 8);
}

/* As many connections are answered without a ray as where walls are clean, within 0.4 %: noise must not split a wall
 * into layers, orientations or densities. (It adds rays of its own: pairs on one wall that were exactly coplanar.) */
static void noisy_walls(void **state)
{
    (void)state;
    const float angles[] = {0.0f, 0.7f}, noise[] = {0.0f, 0x1p-24f, 0x1p-22f, 0x1p-18f};
    for (int a = 0; a < 2; a++) {
        double clean = 0.0;
        for (int i = 0; i < 4; i++) {
            stage g = noisy_room(noise[i], angles[a]);
            frame f = picture(&g, VISIBILITY_CACHE);
            double answered = (double)(f.rays.asked - f.rays.traced);
            if (i == 0)
                clean = answered;
            print_message("angle %.1f, noise %g: %.2f %% traced, %.4f of the clean one's answers\n", (double)angles[a],
                          (double)noise[i], 100.0 * share(&f), answered / clean);
            assert_true(fabs(answered / clean - 1.0) < 0.004 && share(&f) < 0.25);
            frame_free(&f);
            stage_free(&g);
        }
    }
}

/* ---------------------------------------------------------------------------------------------------- far, turned */

/* The same rays (within 2 %) at a thousand times the scene's size. Turned by any angle, tilted walls meet other bins
 * and layers and take up to a fifth more or fewer; the error stays within half as much again. */
static void far_and_turned(void **state)
{
    (void)state;
    const int kinds[] = {ROOM_LAMP, ROOM_POINT, ROOM_SUN, ROOM_SKY};
    const struct {
        float angle;
        vec3 offset;
    } places[] = {
        {0, {0, 0, 0}}, {0, {40, -40, 40}}, {0, {4000, 0, -3000}}, {0.4f, {0, 0, 0}}, {2.1f, {-400, 4000, 7}}};
    for (int k = 0; k < 4; k += case_step()) {
        double rays = 0.0, error = 0.0;
        for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
            scene *s = room_scene(kinds[k]);
            camera c = room_camera();
            float m[12];
            motion(places[i].angle, places[i].offset, m);
            move_scene(s, &c, m);
            stage g = cached_stage(s, c, 64, 48, 8);
            frame exact = picture(&g, VISIBILITY_EXACT), f = picture(&g, VISIBILITY_CACHE);
            double e = l_inf(&f.image, &exact.image);
            if (i == 0)
                rays = share(&f), error = e;
            print_message("light %d, place %zu: %.4f of the rays, error %.2f %% (%.2f %%)\n", kinds[k], i,
                          share(&f) / rays, 100.0 * e, 100.0 * error);
            bool turned = places[i].angle != 0.0f;
            assert_true(fabs(share(&f) / rays - 1.0) < (turned ? 0.2 : 0.02));
            assert_true(e < (turned ? 1.3 : 1.1) * error);
            frame_free(&exact);
            frame_free(&f);
            stage_free(&g);
        }
    }
}

/* ---------------------------------------------------------------------------------------------------- thin walls */

/* A lit room at x > 0 and a dark one at x < 0 behind two walls 1e-4 of the scene apart, both open towards +z, where
 * there is nothing. `turned`: the dark one is turned by 45 degrees around x, so that only the two sides of the walls in
 * between are parallel, and these look opposite ways: no cell may answer for both rooms. Else the floors are one
 * plane, and cells across the wall are shared. */
static stage two_rooms(int kind, bool turned)
{
    scene *s = scene_new("rooms");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[lamp].emission = v3(5, 5, 5);
    add_box(s, v3(0, -1, -1), v3(2, 1, 1), 31, grey);
    uint32_t first = s->instance_count;
    add_box(s, v3(-2, -1, -1), v3(-4e-4f, 1, 1), turned ? 31u & ~8u : 31u, grey);
    const float turn[12] = {1, 0, 0, 0, 0, 0.5f, -0.5f, 0, 0, 0.5f, 0.5f, 0};
    for (uint32_t i = first; turned && i < s->instance_count; i++)
        memcpy(s->instances[i].to_world, turn, sizeof turn);
    if (kind == ROOM_LAMP)
        add_quad(s, v3(0.3f, 0.9f, -0.3f), v3(0.5f, 0, 0), v3(0, 0, 0.5f), lamp);
    else
        add_point_light(s, v3(0.3f, 0.2f, 0.1f), 2.0f);
    return cached_stage(s, camera_look(v3(-0.3f, 0, 4.5f), v3(-0.1f, 0, 0), v3(0, 1, 0), 0.6f), 48, 24, 8);
}

/* Means over the pixels that are lit in `exact`, and over those that meet a surface and are black there. */
static double means(const frame *exact, const frame *f, double *dark)
{
    double sums[2] = {0.0, 0.0}, n[2] = {0.0, 0.0};
    for (size_t i = 0; i < (size_t)f->image.width * f->image.height; i++) {
        int lit = luminance(exact->image.pixels[i]) > 0.0f;
        if (exact->depth[i] > 0.0f)
            sums[lit] += (double)luminance(f->image.pixels[i]), n[lit] += 1.0;
    }
    assert_true(n[0] > 200.0 && n[1] > 200.0);
    *dark = sums[0] / n[0];
    return sums[1] / n[1];
}

/* Black pixels stay black at every C_E where no cell belongs to both rooms. Where cells reach from one floor into the
 * other, what leaks is a share of the lit room's light that falls with C_E, and is nothing with the smallest cells. */
static void thin_walls(void **state)
{
    (void)state;
    const struct {
        float ce;
        double leak; /* at most, of the lit room's light, on common planes */
    } cases[] = {{0.01f, 0.0}, {1, 0.0005}, {4, 0.005}, {12, 0.02}, {100, 0.005}, {1000, 0.0}};
    for (int kind = ROOM_LAMP; kind <= ROOM_POINT; kind++)
        for (int turned = 0; turned < 2; turned++) {
            stage g = two_rooms(kind, turned);
            frame exact = picture(&g, VISIBILITY_EXACT);
            for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
                g.v.settings.ce = cases[i].ce;
                frame f = picture(&g, VISIBILITY_CACHE);
                double dark, lit = means(&exact, &f, &dark);
                print_message("light %d, turned %d, C_E = %g: %.3g of the light leaks, %.1f %% traced\n", kind, turned,
                              (double)cases[i].ce, dark / lit, 100.0 * share(&f));
                assert_true(turned ? dark == 0.0 : dark <= cases[i].leak * lit);
                frame_free(&f);
            }
            g.v.settings.ce = 12.0f;
            g.v.settings.spp = 4;
            tally t = {0};
            for (int i = 0; i < 12; i++) {
                g.v.settings.seed = 10 + (uint64_t)i;
                frame f = picture(&g, VISIBILITY_ESTIMATE);
                double dark;
                means(&exact, &f, &dark);
                tally_add(&t, dark);
                frame_free(&f);
            }
            print_message("estimates: %.5f +- %.5f\n", tally_mean(&t), tally_error(&t));
            assert_true(fabs(tally_mean(&t)) <= 3.0 * tally_error(&t));
            frame_free(&exact);
            stage_free(&g);
        }
}

/* ------------------------------------------------------------------------------------------------------ contacts */

/* A point light or a small lamp close above a floor, between small teeth: where their shadows lie, all connections are
 * shorter than a cell, and so the picture is the exact one there, and not where they are longer. */
static void contact_shadows(void **state)
{
    (void)state;
    enum { SIZE = 64 };
    for (int kind = ROOM_LAMP; kind <= ROOM_POINT; kind++) {
        scene *s = scene_new("contact");
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
        s->materials[lamp].emission = v3(1e4f, 1e4f, 1e4f);
        add_quad(s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), grey);
        for (int i = 0; i < 24; i++) {
            float x = 0.06f * cosf(2.0f * PI_F * (float)i / 24.0f), z = 0.06f * sinf(2.0f * PI_F * (float)i / 24.0f);
            add_box(s, v3(x - 0.004f, 0, z - 0.004f), v3(x + 0.004f, 0.08f, z + 0.004f), 63, grey);
        }
        if (kind == ROOM_LAMP)
            add_quad(s, v3(-0.005f, 0.05f, -0.005f), v3(0.01f, 0, 0), v3(0, 0, 0.01f), lamp);
        else
            add_point_light(s, v3(0, 0.05f, 0), 1.0f);
        stage g = cached_stage(s, camera_look(v3(0, 3, 0), v3(0, 0, 0), v3(0, 0, -1), 0.64350111f), SIZE, SIZE, 4);
        settings *o = &g.v.settings;
        o->edges = 2;
        /* P_e is 1 / 4 a unit of area, P_l of the lamp 1e4, N_P 16384: cells of half a unit */
        o->epoch = 4;
        o->ce = kind == ROOM_LAMP ? 1600.0f : 32.0f;
        frame exact = picture(&g, VISIBILITY_EXACT), f = picture(&g, VISIBILITY_CACHE);
        int near_wrong = 0, far_wrong = 0;
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                float dx = ((float)x + 0.5f) / SIZE * 2.0f - 1.0f, dy = ((float)y + 0.5f) / SIZE * 2.0f - 1.0f;
                int wrong = memcmp(&exact.image.pixels[y * SIZE + x], &f.image.pixels[y * SIZE + x], sizeof(rgb)) != 0;
                *(dx * dx + dy * dy < 0.25f * 0.25f ? &near_wrong : &far_wrong) += wrong;
            }
        print_message("light %d: %d pixels wrong near it, %d elsewhere, %.1f %% traced\n", kind, near_wrong, far_wrong,
                      100.0 * share(&f));
        assert_true(near_wrong == 0 && far_wrong > 50 && share(&f) < 0.5);
        frame_free(&exact);
        frame_free(&f);
        stage_free(&g);
    }
}

/* Where a cell is as large as the scene, all connections to surfaces and points are shorter: the exact picture, bit for
 * bit, by as many rays. With the smallest cells each connection has its own pair of cells, but for ends that coincide
 * in floats and words that others overwrite between the first and the second time: next to all are traced, and what is
 * answered is right but at a shadow's edge. */
static void largest_and_smallest_cells(void **state)
{
    (void)state;
    for (int kind = ROOM_LAMP; kind <= ROOM_SPOT; kind++)
        for (int threads = 1; threads <= 3; threads += 2) {
            stage g = cached_stage(room_scene(kind), room_camera(), 48, 36, 4);
            g.v.settings.threads = threads;
            frame exact = picture(&g, VISIBILITY_EXACT);
            g.v.settings.ce = 10000.0f;
            frame large = picture(&g, VISIBILITY_CACHE);
            g.v.settings.ce = 0.01f;
            frame small = picture(&g, VISIBILITY_CACHE);
            print_message("light %d: large %.4f traced, %.4f of the pixels differ; small %.4f, %.4f\n", kind,
                          share(&large), different(&large.image, &exact.image), share(&small),
                          different(&small.image, &exact.image));
            assert_true(large.rays.traced == large.rays.asked && different(&large.image, &exact.image) == 0.0);
            assert_true(share(&small) > 0.99 && different(&small.image, &exact.image) < 0.002);
            frame_free(&exact);
            frame_free(&large);
            frame_free(&small);
            stage_free(&g);
        }
}

/* ------------------------------------------------------------------------------------------------------- options */

/* Each option at its ends, and all of them at once; threads share a cache. */
static void extreme_options(void **state)
{
    (void)state;
    const struct {
        float ce, step;
        int bins, layers, epoch;
        uint64_t bytes;
    } cases[] = {{12, 1.2f, 8, 8, 16, 1 << 20},      {0.01f, 1.2f, 8, 8, 16, 1 << 24}, {10000, 1.2f, 8, 8, 16, 1 << 24},
                 {12, 1.2f, 1, 8, 16, 1 << 24},      {12, 1.2f, 64, 8, 16, 1 << 24},   {12, 1.2f, 8, 1, 16, 1 << 24},
                 {12, 1.2f, 8, 64, 16, 1 << 24},     {12, 1.05f, 8, 8, 16, 1 << 24},   {12, 16, 8, 8, 16, 1 << 24},
                 {12, 1.2f, 8, 8, 1, 1 << 24},       {12, 1.2f, 8, 8, 1 << 20, 4},     {0.01f, 1.05f, 64, 64, 1, 4},
                 {10000, 16, 1, 1, 1 << 20, 1 << 24}};
    const int kinds[] = {ROOM_LAMP, ROOM_POINT, ROOM_SKY};
    for (int k = 0; k < 3; k++) {
        stage g = cached_stage(room_scene(kinds[k]), room_camera(), 48, 36, 2);
        settings *f = &g.v.settings;
        frame exact = picture(&g, VISIBILITY_EXACT);
        for (size_t run = (size_t)case_step() - 1; run < 2 * sizeof cases / sizeof *cases; run += (size_t)case_step()) {
            size_t i = run / 2;
            f->threads = run % 2 ? 3 : 1;
            f->ce = cases[i].ce;
            f->epoch = cases[i].epoch;
            f->cache.resolution_step = cases[i].step;
            f->cache.normal_bins = cases[i].bins;
            f->cache.layers = cases[i].layers;
            f->cache.table_bytes = cases[i].bytes;
            frame cached = picture(&g, VISIBILITY_CACHE), estimate = picture(&g, VISIBILITY_ESTIMATE);
            double error = l_inf(&cached.image, &exact.image), noise = l_inf(&estimate.image, &exact.image);
            print_message("light %d, case %zu, threads %d: %.1f %% traced, error %.2f %%; estimate %.1f %%, %.2f %%\n",
                          kinds[k], i, f->threads, 100.0 * share(&cached), 100.0 * error, 100.0 * share(&estimate),
                          100.0 * noise);
            assert_true(cached.rays.asked == exact.rays.asked && estimate.rays.asked == exact.rays.asked);
            /* racing: who asks first decides what a cell answers, for much of the scene where cells are as large as it
             */
            bool chance = f->threads > 1 && f->ce > 1000.0f;
            assert_true(error < (chance ? 0.5 : kinds[k] == ROOM_SKY ? 0.2 : 0.12) && noise < 0.2);
            if (f->ce < 1.0f || f->cache.table_bytes == 4) /* a pair of cells a connection; a word for all pairs */
                assert_true(share(&cached) > 0.99 && error < 1e-3);
            frame_free(&cached);
            frame_free(&estimate);
        }
        frame_free(&exact);
        stage_free(&g);
    }
}

/* ---------------------------------------------------------------------------------------------------- triangles */

/* A triangle under the room's floor of half edge `half`, or cut into needles that meet in one corner. */
static stage on_a_triangle(bool needles, float half, int kind)
{
    enum { NEEDLES = 400 };
    scene *s = room_scene(kind);
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), count = needles ? NEEDLES : 1;
    vec3 corners[3 * NEEDLES];
    for (uint32_t i = 0; i < count; i++) {
        float a = 2.0f * (float)i / (float)count - 1.0f, b = 2.0f * (float)(i + 1) / (float)count - 1.0f;
        corners[3 * i] = v3(0, -0.95f, -half);
        corners[3 * i + 1] = v3(a * half, -0.95f, half);
        corners[3 * i + 2] = v3(b * half, -0.95f, half);
    }
    add_triangles(s, corners, count, grey);
    return cached_stage(s, room_camera(), 48, 36, 8);
}

/* The floor of one triangle, of needles and of one triangle 1e4 times as large as the room give the same picture: means
 * within 0.1 % for the needles (the same paths but for rounding), within 2 % for the giant (paths differ); a floor that
 * shadows itself would lose a tenth of it and more. */
static void needles_and_giants(void **state)
{
    (void)state;
    const int kinds[] = {ROOM_LAMP, ROOM_POINT};
    for (int k = 0; k < 2; k++)
        for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++) {
            double mean[3];
            for (int i = 0; i < 3; i++) {
                stage g = on_a_triangle(i == 1, i == 2 ? 2e4f : 20.0f, kinds[k]);
                frame f = picture(&g, (visibility_mode)mode);
                mean[i] = image_mean(&f.image);
                print_message("light %d, mode %d, floor %d: mean %.5f, %.1f %% traced\n", kinds[k], mode, i, mean[i],
                              100.0 * share(&f));
                frame_free(&f);
                stage_free(&g);
            }
            assert_true(fabs(mean[1] / mean[0] - 1.0) < (mode == VISIBILITY_ESTIMATE ? 0.02 : 0.001));
            assert_true(fabs(mean[2] / mean[0] - 1.0) < 0.02);
        }
}

static void add_with_normals(scene *s, const vec3 *corners, uint32_t count, vec3 normal, uint32_t material_index)
{
    mesh m = corners_mesh(corners, count, material_index);
    m.normals = xmalloc(9 * (size_t)count * sizeof(float));
    for (uint32_t i = 0; i < 3 * count; i++)
        memcpy(m.normals + 3 * (size_t)i, &normal, sizeof normal);
    place_mesh(s, scene_add_mesh(s, m), transform_identity);
}

/* A square with shading normals that are 0, NaN or infinite, or look into it, is the flat one bit for bit. */
static void useless_normals(void **state)
{
    (void)state;
    const vec3 normals[] = {{0, 1, 0}, {0, 0, 0}, {NAN, 0, 1}, {INFINITY, 0, 0}, {0, -1, 0}};
    const vec3 a = {-0.8f, -0.5f, 0.6f}, b = {-0.8f, -0.5f, 1.4f}, c = {0.8f, -0.5f, 1.4f}, d = {0.8f, -0.5f, 0.6f};
    const vec3 square[6] = {a, b, c, a, c, d};
    frame flat = {0};
    for (int i = 0; i < 5; i++) {
        scene *s = room_scene(ROOM_POINT);
        add_with_normals(s, square, 2, normals[i], add_material(s, MATERIAL_GLOSSY, 0.6f));
        stage g = cached_stage(s, room_camera(), 32, 24, 2);
        frame f = picture(&g, VISIBILITY_CACHE);
        if (i == 0) {
            flat = f;
        } else {
            assert_true(different(&f.image, &flat.image) == 0.0);
            frame_free(&f);
        }
        stage_free(&g);
    }
    frame_free(&flat);
}

/* Faces without area, needles, dust, emitting needles and dust, shading normals that are 0, NaN, infinite or look into
 * the surface, among them triangles 1e5 times as large as the room. */
static void degenerate_triangles(void **state)
{
    (void)state;
    for (int kind = 0; kind < ROOMS; kind += case_step()) {
        scene *s = room_scene(kind);
        rng r = rng_make(5, 1);
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), gloss = add_material(s, MATERIAL_GLOSSY, 0.6f);
        uint32_t glass = add_material(s, MATERIAL_DIELECTRIC, 1.0f), lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
        const uint32_t materials[] = {grey, gloss, glass, lamp};
        s->materials[lamp].emission = v3(1, 1, 1);
        s->materials[lamp].two_sided = true;
        for (int i = 0; i < 4; i++) {
            vec3 needles[3 * 50];
            for (int k = 0; k < 50; k++) {
                needles[3 * k] = random_vec3(&r, 1.0f);
                needles[3 * k + 1] = random_vec3(&r, 1.0f);
                needles[3 * k + 2] = v3_add(needles[3 * k + 1], random_vec3(&r, 1e-5f));
            }
            add_triangles(s, needles, 50, materials[i]);
            place_mesh(s, scene_add_mesh(s, soup_mesh(&r, 2000, 1e-4f, 0.5f, v3(0, 0, 1), materials[i])),
                       transform_identity);
        }
        const vec3 flat[] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {1, 0, 1}, {0.5f, 0, 1}};
        add_triangles(s, flat, 2, grey);
        const vec3 normals[] = {{0, 0, 0}, {NAN, 0, 1}, {INFINITY, 0, 0}, {0, -1, 0}, {0, 1e-6f, 1}, {1e-30f, 0, 0}};
        for (int i = 0; i < 6; i++) {
            vec3 a = v3(-1.5f + 0.5f * (float)i, -0.5f, 1), square[6] = {a, a, a, a, a, a};
            square[2].z += 0.4f, square[1].z += 0.4f, square[1].x += 0.4f;
            square[5].x += 0.4f, square[4].x += 0.4f, square[4].z += 0.4f;
            vec3 keep = square[1];
            square[1] = square[2], square[2] = keep;
            add_with_normals(s, square, 2, normals[i], i % 2 ? gloss : grey);
        }
        add_quad(s, v3(-2e5f, -1.5f, -2e5f), v3(0, 0, 4e5f), v3(4e5f, 0, 0), grey);
        stage g = cached_stage(s, room_camera(), 32, 24, 2);
        g.v.settings.threads = 3;
        for (int partners = 1; partners <= 4; partners *= 4)
            for (int h = 0; h < 2; h++) {
                g.v.settings.partners = partners;
                g.v.settings.heuristic = h ? HEURISTIC_POWER : HEURISTIC_BALANCE;
                double mean = 0.0;
                for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++) {
                    frame f = picture(&g, (visibility_mode)mode);
                    if (mode == VISIBILITY_EXACT)
                        mean = image_mean(&f.image);
                    print_message("light %d, partners %d, heuristic %d, mode %d: mean %.5f, %.1f %% traced\n", kind,
                                  partners, h, mode, image_mean(&f.image), 100.0 * share(&f));
                    assert_true(mean > 0.0 && fabs(image_mean(&f.image) / mean - 1.0) < 0.15);
                    frame_free(&f);
                }
            }
        stage_free(&g);
    }
}

/* Argument: the one test to run. */
int main(int argc, char *argv[])
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noisy_walls),
        cmocka_unit_test(far_and_turned),
        cmocka_unit_test(thin_walls),
        cmocka_unit_test(contact_shadows),
        cmocka_unit_test(largest_and_smallest_cells),
        cmocka_unit_test(extreme_options),
        cmocka_unit_test(needles_and_giants),
        cmocka_unit_test(useless_normals),
        cmocka_unit_test(degenerate_triangles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
