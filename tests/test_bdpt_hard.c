/* SPDX-License-Identifier: Apache-2.0 */
/* Numerical hard cases of bidirectional path tracing with cached and estimated connections: noisy, far, thin,
 * degenerate and closed scenes, extreme settings. Images of one seed have the same paths in each mode, so that their
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

/* Of an estimate a pixel may be below 0: what is expected but not found counts more than once. */
static bool finite_image(const image *a)
{
    for (size_t i = 0; i < (size_t)a->width * a->height; i++)
        if (!isfinite(a->pixels[i].x) || !isfinite(a->pixels[i].y) || !isfinite(a->pixels[i].z))
            return false;
    return true;
}

/* In this mode; the picture must be one. */
static frame picture(stage *g, visibility_mode mode)
{
    frame f = stage_frame(g, mode, NULL);
    if (!(mode == VISIBILITY_ESTIMATE ? finite_image(&f.image) : sane(&f.image)))
        fail_msg("mode %d: a pixel is NaN, infinite or negative", (int)mode);
    return f;
}

static double share(const frame *f)
{
    return (double)f->rays.traced / (double)f->rays.asked;
}

/* Estimates against exact connections of the same paths: mean of the difference, in units of the exact mean. */
static void assert_no_bias(stage *g, int seeds, const char *what)
{
    tally t = {0};
    for (int i = 0; i < seeds; i++) {
        g->v.settings.seed = 100 + (uint64_t)i;
        frame exact = picture(g, VISIBILITY_EXACT), other = picture(g, VISIBILITY_ESTIMATE);
        tally_add(&t, (image_mean(&other.image) - image_mean(&exact.image)) / image_mean(&exact.image));
        frame_free(&exact);
        frame_free(&other);
    }
    print_message("%s: estimates differ by %.5f +- %.5f\n", what, tally_mean(&t), tally_error(&t));
    if (!(fabs(tally_mean(&t)) <= 3.0 * tally_error(&t)))
        fail_msg("%s: estimates differ by %f +- %f", what, tally_mean(&t), tally_error(&t));
}

/* Moves all of a scene by a rotation and an offset. */
static void move_scene(scene *s, camera *c, const float m[12])
{
    for (uint32_t i = 0; i < s->instance_count; i++) {
        float *to = s->instances[i].to_world, old[12];
        memcpy(old, to, sizeof old);
        for (int r = 0; r < 3; r++)
            for (int k = 0; k < 4; k++)
                to[4 * r + k] = m[4 * r] * old[k] + m[4 * r + 1] * old[4 + k] + m[4 * r + 2] * old[8 + k] +
                                (k == 3 ? m[4 * r + 3] : 0.0f);
    }
    for (uint32_t i = 0; i < s->light_count; i++) {
        s->lights[i].position = transform_point(m, s->lights[i].position);
        s->lights[i].direction = v3_normalize(transform_vector(m, s->lights[i].direction));
    }
    *c = camera_look(transform_point(m, c->eye), transform_point(m, v3_add(c->eye, c->forward)),
                     transform_vector(m, c->up), c->yfov);
}

/* Around (1, 2, 3), then to `offset`. */
static void motion(float angle, vec3 offset, float m[12])
{
    vec3 a = v3_normalize(v3(1, 2, 3));
    float c = cosf(angle), s = sinf(angle), t = 1.0f - c;
    const float rows[12] = {t * a.x * a.x + c,       t * a.x * a.y - s * a.z, t * a.x * a.z + s * a.y, offset.x,
                            t * a.x * a.y + s * a.z, t * a.y * a.y + c,       t * a.y * a.z - s * a.x, offset.y,
                            t * a.x * a.z - s * a.y, t * a.y * a.z + s * a.x, t * a.z * a.z + c,       offset.z};
    memcpy(m, rows, sizeof rows);
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
    for (int k = 0; k < 4; k++) {
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
            double tolerance = places[i].angle == 0.0f ? 0.02 : 0.2;
            assert_true(fabs(share(&f) / rays - 1.0) < tolerance && e < 1.5 * error);
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
    } cases[] = {{0.01f, 0.0}, {1, 0.002}, {4, 0.01}, {12, 0.05}, {100, 1.0}, {1000, 1.0}};
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
        f->threads = 3;
        frame exact = picture(&g, VISIBILITY_EXACT);
        for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
            f->ce = cases[i].ce;
            f->epoch = cases[i].epoch;
            f->cache.resolution_step = cases[i].step;
            f->cache.normal_bins = cases[i].bins;
            f->cache.layers = cases[i].layers;
            f->cache.table_bytes = cases[i].bytes;
            frame cached = picture(&g, VISIBILITY_CACHE), estimate = picture(&g, VISIBILITY_ESTIMATE);
            double error = l_inf(&cached.image, &exact.image), noise = l_inf(&estimate.image, &exact.image);
            print_message("light %d, case %zu: %.1f %% traced, error %.2f %%; estimate %.1f %%, %.2f %%\n", kinds[k], i,
                          100.0 * share(&cached), 100.0 * error, 100.0 * share(&estimate), 100.0 * noise);
            assert_true(cached.rays.asked == exact.rays.asked && estimate.rays.asked == exact.rays.asked);
            /* which thread asks first decides what a cell answers, for much of the scene where cells are as large as it
             */
            assert_true(error < (f->ce > 1000.0f ? 0.5 : kinds[k] == ROOM_SKY ? 0.3 : 0.2) && noise < 0.3);
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
    for (int kind = 0; kind < ROOMS; kind++) {
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

/* ------------------------------------------------------------------------------------------------ specular chains */

/* Independent renderings. */
static tally mode_tally(stage *g, visibility_mode mode, int seeds)
{
    tally t = {0};
    for (int i = 0; i < seeds; i++) {
        g->v.settings.seed = 1 + (uint64_t)i;
        frame f = picture(g, mode);
        tally_add(&t, image_mean(&f.image));
        frame_free(&f);
    }
    return t;
}

static void assert_within(const tally *t, double expected, double bias, const char *what)
{
    print_message("%s: %f +- %f, expected %f\n", what, tally_mean(t), tally_error(t), expected);
    if (!(fabs(tally_mean(t) - expected) <= 3.0 * tally_error(t) + bias))
        fail_msg("%s: %f +- %f, expected %f", what, tally_mean(t), tally_error(t), expected);
}

static void add_placed_sphere(scene *s, float radius, vec3 at, uint32_t material_index)
{
    const float place[12] = {radius, 0, 0, at.x, 0, radius, 0, at.y, 0, 0, radius, at.z};
    add_sphere(s, 24, true, material_index);
    memcpy(s->instances[s->instance_count - 1].to_world, place, sizeof place);
}

/* In a furnace: two mirrors that face each other, glass in glass, a mirror and a diffuse ball in glass; 0.3 % are
 * allowed for paths that are cut off at 32 edges, and 1 % more for cells that the edges of shadows cross. */
static void specular_chains(void **state)
{
    (void)state;
    const char *const names[] = {"mirrors", "glass in glass", "mirror in glass", "diffuse in glass"};
    for (int i = 0; i < 4; i++) {
        scene *s = furnace();
        uint32_t mirror = add_material(s, MATERIAL_CONDUCTOR, 1.0f), glass = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
        uint32_t heavy = add_material(s, MATERIAL_DIELECTRIC, 1.0f), white = add_material(s, MATERIAL_DIFFUSE, 1.0f);
        s->materials[mirror].roughness = 0.0f;
        s->materials[heavy].ior = 2.2f;
        if (i == 0) {
            add_box(s, v3(-1.0f, -0.8f, -0.8f), v3(-0.9f, 0.8f, 0.8f), 63, mirror);
            add_box(s, v3(0.9f, -0.8f, -0.8f), v3(1.0f, 0.8f, 0.8f), 63, mirror);
        } else {
            add_placed_sphere(s, 1.0f, v3(0, 0, 0), glass);
            add_placed_sphere(s, 0.5f, v3(0.1f, 0, 0), i == 1 ? heavy : i == 2 ? mirror : white);
        }
        stage g = cached_stage(s, inside(), 32, 24, 4);
        for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++) {
            tally t = mode_tally(&g, (visibility_mode)mode, 10);
            assert_within(&t, 1.0, mode == VISIBILITY_CACHE ? 0.013 : 0.003, names[i]);
            assert_true(tally_error(&t) < 0.004);
        }
        stage_free(&g);
    }
}

/* Paths that meet the lamp in a glass ball by chance have the mean of all strategies; estimates as well. */
static void emitter_in_glass(void **state)
{
    (void)state;
    scene *s = scene_new("bulb");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f), glass = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    uint32_t lamp = add_material(s, MATERIAL_DIFFUSE, 0.2f);
    s->materials[lamp].emission = v3(10, 10, 10);
    add_quad(s, v3(-2, -1, -2), v3(0, 0, 4), v3(4, 0, 0), grey);
    add_quad(s, v3(-2, -1, -2), v3(4, 0, 0), v3(0, 3, 0), grey);
    add_placed_sphere(s, 0.6f, v3(0, 0, 0), glass);
    add_placed_sphere(s, 0.3f, v3(0, 0, 0), lamp);
    stage g = cached_stage(s, camera_look(v3(0.5f, 1.5f, 3.0f), v3(0, -0.5f, 0), v3(0, 1, 0), 0.8f), 16, 12, 1);
    tally all = mode_tally(&g, VISIBILITY_EXACT, 600);
    g.v.settings.light_vertices = 0;
    tally met = stage_tally(&g, NULL, 2000, 5000);
    assert_same_mean(&met, &all, "met by chance");
    g.v.settings.light_vertices = -1;
    assert_no_bias(&g, 40, "bulb");
    frame exact = picture(&g, VISIBILITY_EXACT), f = picture(&g, VISIBILITY_CACHE);
    assert_true(l_inf(&f.image, &exact.image) < 0.1);
    frame_free(&exact);
    frame_free(&f);
    stage_free(&g);
}

/* A corner under water, lit through its surface: paths that meet the lamp by chance, and those that are connected under
 * water, have the same mean. */
static void under_water(void **state)
{
    (void)state;
    scene *s = scene_new("water");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f), water = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    uint32_t lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[lamp].emission = v3(100, 100, 100);
    add_quad(s, v3(-1, -1, -1), v3(0, 0, 2), v3(2, 0, 0), grey);
    add_quad(s, v3(-1, -1, -1), v3(2, 0, 0), v3(0, 0.9f, 0), grey);
    add_quad(s, v3(-20, 0, -20), v3(0, 0, 40), v3(40, 0, 0), water);
    add_quad(s, v3(-1, 1.5f, -1), v3(2, 0, 0), v3(0, 0, 2), lamp);
    stage g = cached_stage(s, camera_look(v3(0, 1.2f, 1.8f), v3(0, -0.9f, -0.9f), v3(0, 1, 0), 0.5f), 16, 12, 1);
    settings *f = &g.v.settings;
    f->edges = 5;
    tally all = stage_tally(&g, NULL, 1000, 1);
    f->light_vertices = 0;
    tally met = stage_tally(&g, NULL, 2000, 5000);
    f->light_vertices = 3;
    tally connected = stage_tally(&g, NULL, 2000, 10000);
    assert_same_mean(&connected, &met, "connected under water, met by chance");
    assert_same_mean(&all, &met, "all, met by chance");
    assert_true(tally_error(&connected) < 0.05 * tally_mean(&connected));
    stage_free(&g);
}

/* ------------------------------------------------------------------------------------------------- lights, none */

/* A floor alone under one light: what it reflects is known, and nothing is hidden, so the cache has no error either. */
static void lights_alone(void **state)
{
    (void)state;
    const char *const names[] = {"point", "directional", "environment"};
    for (int i = 0; i < 3; i++) {
        scene *s = scene_new("light");
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.5f);
        add_quad(s, v3(-10, 0, -10), v3(0, 0, 20), v3(20, 0, 0), grey);
        double expected = 0.5 / 3.14159265358979;
        if (i == 0)
            add_point_light(s, v3(0, 2, 0), 4.0f);
        else if (i == 1)
            scene_add_light(s,
                            (light){.kind = LIGHT_DIRECTIONAL, .direction = {0.6f, -0.8f, 0}, .intensity = {1, 1, 1}});
        else
            s->environment = environment_uniform(v3(1, 1, 1));
        expected *= i == 0 ? 1.0 : i == 1 ? 0.8 : 3.14159265358979;
        stage g = cached_stage(s, camera_look(v3(0, 3, 0), v3(0, 0, 0), v3(0, 0, -1), 0.02f), 24, 18, 4);
        for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++)
            for (int partners = 1; partners <= 4; partners += 3) {
                g.v.settings.partners = partners;
                tally t = mode_tally(&g, (visibility_mode)mode, 10);
                assert_within(&t, expected, 1e-3 * expected, names[i]); /* angles over the picture */
                assert_true(tally_error(&t) < 0.02 * expected);
            }
        stage_free(&g);
    }
}

/* No light at all, a light of no power, and the camera in a closed box, black or grey, in a lit room: black pictures.
 */
static void darkness(void **state)
{
    (void)state;
    for (int i = 0; i < 5; i++) {
        scene *s = i < 2 ? scene_new("dark") : room_scene(i < 4 ? ROOM_LAMP : ROOM_SKY);
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f), black = add_material(s, MATERIAL_DIFFUSE, 0.0f);
        if (i < 2) {
            add_box(s, v3(-2, -2, -2), v3(2, 2, 2), 31, grey);
            add_placed_sphere(s, 0.5f, v3(0, 0, 0), grey);
            if (i == 0)
                s->environment = environment_uniform(v3(0, 0, 0));
            else
                add_point_light(s, v3(0, 1, 0), 0.0f);
        } else {
            add_box(s, v3(0.1f, 0.2f, 3.0f), v3(0.7f, 0.8f, 4.0f), 63, i == 2 ? black : grey);
        }
        stage g = cached_stage(s, room_camera(), 32, 24, 4);
        assert_true((g.l == NULL) == (i < 2));
        for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++) {
            frame f = picture(&g, (visibility_mode)mode);
            if (mode != VISIBILITY_ESTIMATE || i <= 2)
                assert_true(image_mean(&f.image) == 0.0);
            assert_true(i <= 2 ? f.rays.asked == 0 : f.rays.asked > 1000);
            frame_free(&f);
        }
        stage_free(&g);
    }
}

/* ------------------------------------------------------------------------------------------------------ partners */

/* A furnace with a ball has radiance 1 with any number of partners, also in pictures whose batches have fewer paths
 * than that. */
static void few_partners(void **state)
{
    (void)state;
    const int partners[] = {1, 4, 64}, sizes[][2] = {{3, 5}, {1, 1}, {18, 3}};
    /* pictures of 15, 1, and 48 + 6 paths a batch; a share of the paths has so many partners */
    const double batches[][2] = {{15, 0}, {1, 0}, {48, 6}};
    for (int i = 0; i < 3; i++) {
        double asked = 0.0;
        for (int k = 0; k < 3; k++) {
            scene *s = furnace();
            add_placed_sphere(s, 1.0f, v3(0, 0, 0), add_material(s, MATERIAL_DIFFUSE, 1.0f));
            stage g = cached_stage(s, inside(), (uint32_t)sizes[i][0], (uint32_t)sizes[i][1], 1);
            g.v.settings.partners = partners[k];
            tally t = {0};
            uint64_t count = 0;
            for (int n = 0; n < 1000; n++) {
                g.v.settings.seed = 1 + (uint64_t)n;
                frame f = picture(&g, VISIBILITY_EXACT);
                tally_add(&t, image_mean(&f.image));
                count += f.rays.asked;
                frame_free(&f);
            }
            char name[64];
            snprintf(name, sizeof name, "%dx%d, %d partners", sizes[i][0], sizes[i][1], partners[k]);
            assert_within(&t, 1.0, 0.0, name);
            if (k == 0)
                asked = (double)count;
            const double *b = batches[i];
            double more = (b[0] * fmin(partners[k], b[0]) + b[1] * fmin(partners[k], b[1])) / (b[0] + b[1]);
            print_message("%.3f times the connections, expected %.3f\n", (double)count / asked, more);
            assert_true(fabs((double)count / asked / more - 1.0) < 0.05);
            stage_free(&g);
        }
    }
}

/* Batches of 64, 16 and 1 paths in one picture, of a floor of which a spot lights what is seen: paths from the light
 * weigh as much as connections. The single path in the last pixel has the mean that it has with one partner. */
static void unequal_batches(void **state)
{
    (void)state;
    enum { SIZE = 17, PARTNERS = 64 };
    scene *s = scene_new("spot");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.5f);
    add_quad(s, v3(-10, 0, -10), v3(0, 0, 20), v3(20, 0, 0), grey);
    scene_add_light(s, (light){.kind = LIGHT_SPOT,
                               .position = {0, 4, 0},
                               .direction = {0, -1, 0},
                               .intensity = {16, 16, 16},
                               .cos_inner = 0.9f,
                               .cos_outer = 0.89f});
    stage g = cached_stage(s, camera_look(v3(0, 3, 0), v3(0, 0, 0), v3(0, 0, -1), 0.64350111f), SIZE, SIZE, 1);
    double d2 = 2.0 * pow(16.0 / 17.0, 2) + 16.0; /* the light is so far from the floor there */
    double expected = 0.5 / 3.14159265358979 * 16.0 * 4.0 / pow(d2, 1.5);
    for (int partners = 1; partners <= PARTNERS; partners *= PARTNERS) {
        g.v.settings.partners = partners;
        tally all = {0}, last = {0};
        for (int n = 0; n < 600; n++) {
            g.v.settings.seed = 1 + (uint64_t)n;
            frame f = picture(&g, VISIBILITY_EXACT);
            tally_add(&all, image_mean(&f.image));
            tally_add(&last, (double)luminance(f.image.pixels[SIZE * SIZE - 1]));
            frame_free(&f);
        }
        print_message("%d partners: mean %f +- %f\n", partners, tally_mean(&all), tally_error(&all));
        assert_within(&last, expected, 1e-3 * expected, "last pixel"); /* floats, the angle over the pixel */
        assert_true(tally_error(&last) < 0.05 * expected);
    }
    stage_free(&g);
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
        cmocka_unit_test(specular_chains),
        cmocka_unit_test(emitter_in_glass),
        cmocka_unit_test(under_water),
        cmocka_unit_test(lights_alone),
        cmocka_unit_test(darkness),
        cmocka_unit_test(few_partners),
        cmocka_unit_test(unequal_batches),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
