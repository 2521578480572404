/* SPDX-License-Identifier: Apache-2.0 */
/* Where is the cache wrong, and by how much? A worker that verifies traces everything, and reports. Leaves pictures of
 * the cells in false colours, of the light that was wrong, and of the rays that were traced.
 *     debug [CELLS.ppm WRONG.ppm TRACED.ppm] */
#include "host.h"

static float wrong[PIXELS], traced[PIXELS], lights[PIXELS][LAMPS];

/* `user` of an eye end is its pixel, of a lamp its number. */
static void report(void *context, const vcache_misprediction *m)
{
    double *leaked = context;
    float light = lights[m->ray.eye_user][m->ray.light_user];
    wrong[m->ray.eye_user] += light;
    *leaked += m->visible ? 0.0 : (double)light;
}

/* A colour for each cell, from its number. */
static void color_of(uint64_t cell, unsigned char rgb[3])
{
    for (int k = 0; k < 3; k++)
        rgb[k] = cell ? (unsigned char)(64 + (cell * 0x9e3779b97f4a7c15u >> (24 + 8 * k)) % 192) : 0;
}

int main(int argc, char *argv[])
{
    static float image[PIXELS], exact[PIXELS];
    static unsigned char cells[PIXELS][3];
    char message[VCACHE_MESSAGE_BYTES];
    double leaked = 0.0, sum = 0.0;
    make_scene(0.0f);
    vcache_config config = config_of_scene();
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    vcache_worker_config verifying = vcache_default_worker_config();
    verifying.verify = true;
    verifying.report = report;
    verifying.report_context = &leaked;
    vcache_worker *worker;
    check(vcache_worker_create(cache, &verifying, &worker, message), message);

    uint64_t eye[VCACHE_EYE_BYTES / 8], before = 0;
    for (int i = 0; i < PIXELS; i++) {
        hit h;
        if (!see(i, 0, 0.0f, &h))
            continue;
        vcache_surface surface = surface_of(&h, 1.0f);
        surface.user = (uint64_t)i;
        vcache_prepare_eye(cache, &surface, 8.0f, 0, (vcache_eye *)eye);
        color_of(vcache_eye_cell((vcache_eye *)eye, 0), cells[i]);
        for (int l = 0; l < LAMPS; l++) {
            float light = lights[i][l] = light_of(&h, l);
            if (light > 0.0f &&
                vcache_visible(worker, (vcache_eye *)eye, vcache_light_at(lamps, (size_t)l), trace, NULL))
                image[i] += light;
            if (light > 0.0f && !occluded(h.position, lamp_at(l)))
                exact[i] += light;
        }
        uint64_t now = statistics_of(worker).traced;
        traced[i] = (float)(now - before) / LAMPS;
        before = now;
        sum += (double)exact[i];
    }
    vcache_statistics s = statistics_of(worker);
    print_figures("", s.asked, s.traced, image_error(image, exact, PIXELS));
    printf("verified %llu, wrong %.2f %%: %llu of them shadows lost, %llu found where none are\n",
           (unsigned long long)s.verified, 100.0 * (double)s.mispredicted / (double)s.verified,
           (unsigned long long)s.leaked, (unsigned long long)(s.mispredicted - s.leaked));
    printf("light that leaked: %.2f %% of the picture's\n", 100.0 * leaked / sum);
    vcache_worker_destroy(&worker);
    free(lamps);
    vcache_destroy(&cache);
    if (argc == 4) {
        FILE *f = fopen(argv[1], "wb");
        if (!f || fprintf(f, "P6\n%d %d\n255\n", WIDTH, HEIGHT) < 0 || fwrite(cells, 3, PIXELS, f) != PIXELS ||
            fclose(f)) {
            perror(argv[1]);
            return 1;
        }
        return write_ppm(argv[2], wrong) && write_ppm(argv[3], traced) ? 0 : 1;
    }
    return 0;
}
