/* SPDX-License-Identifier: Apache-2.0 */
/* The course of a run with a renderer that only counts: which frames are asked for, what becomes of their figures, and
 * what is written of frames that have an image and nothing else. */
#include "comparison.h"
#include "image_fixture.h"
#include "interrupt.h"

#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

enum { WIDTH = 7, HEIGHT = 5, PIXELS = WIDTH * HEIGHT };

typedef struct fake {
    frame_request asked[16];
    int count;
    bool lit;    /* frames have it */
    int fails;   /* the frame, from 1, that cannot be rendered */
    int signals; /* the frame that is interrupted, */
    bool blank;  /* before its first pixel */
} fake;

/* Values that no 16-bit float holds. */
static rgb pixel(int i, bool exact)
{
    return v3(1.0f / 3.0f + (float)i, 1e-30f * (float)i, exact ? 1e30f : 1.5e30f);
}

/* Exact frames take 4, 8, 12 ... s, chosen ones 2 s. */
static bool fake_render(void *context, const frame_request *wanted, frame *out, message *err)
{
    fake *f = context;
    assert_true(f->count < 16);
    f->asked[f->count++] = *wanted;
    if (f->count == f->fails)
        return (fail)(err, "no frame"); /* ours, not the macro */
    if (f->count == f->signals && !interrupted()) /* a second one kills */
        raise(SIGINT);
    if (interrupted() && f->blank)
        return true;
    out->image = image_new(wanted->width, wanted->height);
    for (int i = 0; i < (int)(wanted->width * wanted->height); i++)
        out->image.pixels[i] = pixel(i, wanted->exact);
    if (f->lit)
        out->lit = image_new(wanted->width, wanted->height);
    out->frame_s = wanted->exact ? 2.0 * (f->count + 1) : 2.0;
    out->shade_s = 0.5 * out->frame_s;
    out->rays = (ray_counts){100, wanted->exact ? 100 : 25};
    out->mispredicted = wanted->count ? 3 : 50;
    out->extra = xcalloc(1, sizeof(int));
    out->complete = !interrupted();
    return true;
}

static void fake_json_run(const void *context, const frame *f, cJSON *out)
{
    (void)context;
    json_add_number(out, "half_s", 0.5 * f->frame_s);
}

static void fake_texts(const void *context, const frame *f, bool exact, image_texts *out)
{
    (void)context;
    for (int i = out->count; i < TEXTS_MAX - 6; i++) /* 6 come behind */
        image_text(out, "more", "%s %g", exact ? "exact" : "chosen", f->frame_s);
}

static scene nowhere = {.name = "nowhere", .triangle_count = 1};

static renderer fake_renderer(fake *f)
{
    return (renderer){.context = f, .scene = &nowhere, .mode = "guess", .mispredictions = true, .render = fake_render};
}

static char json_path[512], exr_path[512];

/* runs 0: without --compare */
static program_arguments arguments(int runs)
{
    program_arguments a = program_defaults("test");
    a.size = (option_size){WIDTH, HEIGHT};
    a.quiet = true;
    a.compare = runs > 0;
    a.runs = runs;
    strcpy(json_path, in_folder("x.json"));
    strcpy(exr_path, in_folder("x.exr"));
    a.json = json_path;
    a.outputs.items[a.outputs.count++] = exr_path;
    return a;
}

static cJSON *run(const renderer *r, const program_arguments *a, const image *reference)
{
    message err = {""};
    if (!renderer_run(r, a, reference, &err))
        fail_msg("%s", err.text);
    size_t size = 0;
    unsigned char *text = file_bytes(json_path, &size);
    assert_non_null(text);
    cJSON *j = cJSON_ParseWithLength((const char *)text, size);
    free(text);
    assert_non_null(j);
    return j;
}

static bool has(const cJSON *j, const char *name)
{
    return cJSON_HasObjectItem(j, name);
}

/* NaN where there is none, which equals nothing. */
static double figure(const cJSON *j, const char *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(j, object), name);
    return cJSON_IsNumber(item) ? item->valuedouble : (double)NAN;
}

static bool file_holds(const char *path, const char *text)
{
    size_t size = 0;
    unsigned char *bytes = file_bytes(path, &size);
    assert_non_null(bytes);
    bool found = memmem(bytes, size, text, strlen(text)) != NULL;
    free(bytes);
    return found;
}

static void image_alone(void **state)
{
    (void)state;
    fake f = {0};
    renderer r = fake_renderer(&f);
    r.texts = fake_texts;
    r.json_run = fake_json_run;
    program_arguments a = arguments(0);
    cJSON *j = run(&r, &a, NULL);
    assert_true(f.count == 1 && !f.asked[0].exact && !f.asked[0].count);
    assert_true(f.asked[0].width == WIDTH && f.asked[0].height == HEIGHT);
    assert_true(figure(j, "mode_run", "frame_s") == 2.0 && figure(j, "mode_run", "half_s") == 1.0);
    assert_true(figure(j, "mode_run", "rays_traced") == 25.0);
    assert_false(has(j, "exact") || has(j, "error") || has(j, "speedup") || has(j, "reference"));
    cJSON_Delete(j);

    image read;
    message err = {""};
    assert_true(image_load_exr(exr_path, &read, &err));
    for (int i = 0; i < PIXELS; i++) {
        rgb written = pixel(i, false);
        assert_memory_equal(&read.pixels[i], &written, sizeof written);
    }
    image_free(&read);
    assert_true(file_holds(exr_path, "chosen 2") && file_holds(exr_path, "guess"));
    const char *const absent[] = {"normal.X", "cell.R", "error.R", "depth.Z", "traced.Y"};
    for (size_t i = 0; i < sizeof absent / sizeof *absent; i++)
        assert_false(file_holds(exr_path, absent[i]));
}

static void one_pair_after_a_small_one(void **state)
{
    (void)state;
    fake f = {0};
    renderer r = fake_renderer(&f);
    r.json_run = fake_json_run;
    program_arguments a = arguments(1);
    cJSON *j = run(&r, &a, NULL);
    assert_int_equal(f.count, 4);
    for (int i = 0; i < 4; i++) {
        const frame_request *q = &f.asked[i];
        assert_true(q->exact == (i % 2 == 0) && q->count == (i >= 2));
        assert_true(i < 2 ? q->width == 2 && q->height == 2 : q->width == WIDTH && q->height == HEIGHT);
    }
    assert_true(figure(j, "exact", "frame_s") == 8.0 && figure(j, "exact", "half_s") == 4.0);
    assert_true(figure(j, "exact", "rays") == 100.0 && figure(j, "speedup", "rays") == 4.0);
    assert_true(figure(j, "speedup", "frame") == 4.0);
    assert_true(figure(j, "error", "mispredicted") == 0.03);
    assert_true(figure(j, "error", "l_inf") == figure(j, "error", "l_inf_whole") && figure(j, "error", "l_inf") > 0.1);
    cJSON_Delete(j);
    assert_true(file_holds(exr_path, "error.R"));
}

/* The pair that warms up counts mispredictions and gives no times. */
static void several_pairs(void **state)
{
    (void)state;
    fake f = {.lit = true};
    renderer r = fake_renderer(&f);
    program_arguments a = arguments(3);
    a.reference = "some.exr";
    image reference = image_new(WIDTH, HEIGHT);
    for (int i = 0; i < PIXELS; i++)
        reference.pixels[i] = pixel(i, true);
    cJSON *j = run(&r, &a, &reference);
    image_free(&reference);
    assert_int_equal(f.count, 8);
    for (int i = 0; i < 8; i++)
        assert_true(f.asked[i].width == WIDTH && f.asked[i].count == (i < 2));
    assert_int_equal((int)cJSON_GetObjectItemCaseSensitive(j, "runs")->valuedouble, 3);
    /* 8, 12, 16 s */
    assert_true(figure(j, "exact", "frame_s") == 12.0 && figure(j, "mode_run", "shade_s") == 1.0);
    assert_true(figure(j, "speedup", "frame") == 6.0 && figure(j, "speedup", "frame_min") == 4.0 &&
                figure(j, "speedup", "frame_max") == 8.0);
    assert_true(figure(j, "error", "mispredicted") == 0.03);
    /* what is lit is black, what is seen directly differs */
    assert_true(figure(j, "error", "l_inf") == 0.0 && figure(j, "error", "l_inf_whole") > 0.1);
    const cJSON *errors = cJSON_GetObjectItemCaseSensitive(j, "reference");
    assert_true(figure(errors, "exact", "l_inf") == 0.0 && figure(errors, "mode_run", "l_inf") > 0.1);
    cJSON_Delete(j);
}

static void mispredictions_that_nobody_counts(void **state)
{
    (void)state;
    fake f = {0};
    renderer r = fake_renderer(&f);
    r.mispredictions = false;
    program_arguments a = arguments(2);
    cJSON *j = run(&r, &a, NULL);
    for (int i = 0; i < f.count; i++)
        assert_false(f.asked[i].count);
    assert_true(
        cJSON_IsNull(cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(j, "error"), "mispredicted")));
    cJSON_Delete(j);
}

static void no_frame_no_file(void **state)
{
    (void)state;
    for (int fails = 1; fails <= 4; fails++) {
        fake f = {.fails = fails};
        renderer r = fake_renderer(&f);
        program_arguments a = arguments(1);
        message err = {""};
        empty_folder();
        assert_false(renderer_run(&r, &a, NULL, &err));
        assert_string_equal(err.text, "no frame");
        assert_int_equal(f.count, fails);
        assert_int_equal(files_in_folder(), 0);
    }
}

/* Runs pairs of frames, the given one of them interrupted, in a process of its own, which stays so. True where two
 * older files are as they were afterwards, or are files of an exact frame. */
static bool interrupted_leaves(int runs, int at, bool blank, bool files)
{
    static const char old[] = "older";
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        interrupt_install();
        fake f = {.signals = at, .blank = blank};
        renderer r = fake_renderer(&f);
        r.texts = fake_texts;
        program_arguments a = arguments(runs);
        put_bytes(json_path, old, sizeof old);
        put_bytes(exr_path, old, sizeof old);
        bool ok = renderer_run(&r, &a, NULL, NULL) && f.count == at && interrupted();
        if (files)
            ok = ok && file_holds(json_path, "\"complete\":\tfalse") && file_holds(exr_path, "exact");
        else
            ok = ok && file_holds(json_path, old) && file_holds(exr_path, old);
        _exit(ok ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static void interrupted_before_the_first_pixel(void **state)
{
    (void)state;
    assert_true(interrupted_leaves(0, 1, true, false)); /* alone */
    assert_true(interrupted_leaves(1, 1, true, false)); /* in the small pair */
    assert_true(interrupted_leaves(1, 2, false, false));
    assert_true(interrupted_leaves(1, 3, true, false));
    assert_true(interrupted_leaves(1, 3, false, true));
    assert_true(interrupted_leaves(1, 4, true, true)); /* the exact frame is whole */
    assert_true(interrupted_leaves(5, 1, true, false));
    assert_true(interrupted_leaves(5, 1, false, true));
    assert_true(interrupted_leaves(5, 2, true, true));
}

/* Last: it stays interrupted. */
static void interrupted_in_a_pair(void **state)
{
    (void)state;
    interrupt_install();
    fake f = {.signals = 6}; /* the chosen one of the second timed pair */
    renderer r = fake_renderer(&f);
    program_arguments a = arguments(5);
    cJSON *j = run(&r, &a, NULL);
    assert_int_equal(f.count, 6);
    assert_int_equal((int)cJSON_GetObjectItemCaseSensitive(j, "runs")->valuedouble, 1);
    assert_true(cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(j, "complete")));
    assert_true(figure(j, "exact", "frame_s") == 8.0);
    cJSON_Delete(j);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(image_alone),           cmocka_unit_test(one_pair_after_a_small_one),
        cmocka_unit_test(several_pairs),         cmocka_unit_test(mispredictions_that_nobody_counts),
        cmocka_unit_test(no_frame_no_file),      cmocka_unit_test(interrupted_before_the_first_pixel),
        cmocka_unit_test(interrupted_in_a_pair),
    };
    notice_enable(false);
    return cmocka_run_group_tests(tests, folder_setup, folder_teardown);
}
