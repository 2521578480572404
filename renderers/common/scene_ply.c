/* SPDX-License-Identifier: Apache-2.0 */
/* Reads PLY files (text, binary of either byte order) with vertices and polygons. assimp's reader is not used: it
 * writes out of bounds where a header does not fit its data. */
#include "scene_import.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_ELEMENTS 8
#define MAX_PROPERTIES 32

typedef enum value_type { INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64, TYPE_COUNT } value_type;

static const struct {
    const char *name, *alias;
    uint32_t size;
} value_types[TYPE_COUNT] = {{"char", "int8", 1},     {"uchar", "uint8", 1},   {"short", "int16", 2},
                             {"ushort", "uint16", 2}, {"int", "int32", 4},     {"uint", "uint32", 4},
                             {"float", "float32", 4}, {"double", "float64", 8}};

/* What a property of a vertex means: its place in a row of floats. */
enum { ROW_POSITION, ROW_NORMAL = 3, ROW_UV = 6, ROW_UNUSED = 8, ROW_SIZE };

typedef struct property {
    value_type type, count_type;
    bool is_list, is_indices;
    int slot;
} property;

typedef struct element {
    char name[32];
    uint64_t count;
    property properties[MAX_PROPERTIES];
    uint32_t property_count, slots; /* slots: bit set of those the file has */
} element;

typedef struct ply {
    const char *path;
    const char *at, *end;
    bool text, big_endian;
    element elements[MAX_ELEMENTS];
    uint32_t element_count;
    mesh m;
    size_t index_capacity;
} ply;

/* --- Header --- */

/* Copies the next line; false at the end of the data and for lines that are too long to be a header's. */
static bool next_line(ply *p, char line[256])
{
    const char *stop = memchr(p->at, '\n', (size_t)(p->end - p->at));
    if (!stop || stop - p->at > 255)
        return false;
    size_t length = (size_t)(stop - p->at);
    memcpy(line, p->at, length);
    while (length && line[length - 1] == '\r')
        length--;
    line[length] = 0;
    p->at = stop + 1;
    return true;
}

static bool find_type(const char *name, value_type *out)
{
    for (int i = 0; i < TYPE_COUNT; i++)
        if (strcmp(name, value_types[i].name) == 0 || strcmp(name, value_types[i].alias) == 0) {
            *out = (value_type)i;
            return true;
        }
    return false;
}

static int find_slot(const char *name)
{
    static const struct {
        const char *name;
        int slot;
    } slots[] = {{"x", 0}, {"y", 1}, {"z", 2}, {"nx", 3}, {"ny", 4},        {"nz", 5},
                 {"u", 6}, {"v", 7}, {"s", 6}, {"t", 7},  {"texture_u", 6}, {"texture_v", 7}};
    for (size_t i = 0; i < sizeof slots / sizeof *slots; i++)
        if (strcmp(name, slots[i].name) == 0)
            return slots[i].slot;
    return ROW_UNUSED;
}

static bool read_property(ply *p, const char *line)
{
    char type[32], count_type[32], name[64];
    property q = {.slot = ROW_UNUSED};
    element *e = p->element_count ? &p->elements[p->element_count - 1] : NULL;
    if (!e || e->property_count == MAX_PROPERTIES)
        return false;
    if (sscanf(line, "property list %31s %31s %63s", count_type, type, name) == 3) {
        q.is_list = true;
        if (!find_type(count_type, &q.count_type))
            return false;
    } else if (sscanf(line, "property %31s %63s", type, name) != 2) {
        return false;
    }
    if (!find_type(type, &q.type))
        return false;
    if (!q.is_list && strcmp(e->name, "vertex") == 0)
        q.slot = find_slot(name);
    if (q.is_list && strcmp(e->name, "face") == 0)
        q.is_indices = strcmp(name, "vertex_indices") == 0 || strcmp(name, "vertex_index") == 0;
    e->slots |= 1u << q.slot;
    e->properties[e->property_count++] = q;
    return true;
}

static bool read_header(ply *p, message *err)
{
    char line[256], format[32];
    unsigned long long count;
    if (!next_line(p, line) || strcmp(line, "ply") != 0)
        return fail(err, "%s: not a PLY file", p->path);
    if (!next_line(p, line) || sscanf(line, "format %31s 1.0", format) != 1)
        return fail(err, "%s: the PLY header names no format", p->path);
    p->text = strcmp(format, "ascii") == 0;
    p->big_endian = strcmp(format, "binary_big_endian") == 0;
    if (!p->text && !p->big_endian && strcmp(format, "binary_little_endian") != 0)
        return fail(err, "%s: unknown PLY format '%s'", p->path, format);
    while (next_line(p, line)) {
        element *e = &p->elements[p->element_count];
        if (strcmp(line, "end_header") == 0)
            return true;
        if (strncmp(line, "comment", 7) == 0 || strncmp(line, "obj_info", 8) == 0)
            continue;
        bool is_element = strncmp(line, "element ", 8) == 0 && p->element_count < MAX_ELEMENTS &&
                          sscanf(line, "element %31s %19llu", e->name, &count) == 2;
        if (is_element) {
            e->count = count;
            p->element_count++;
        } else if (!read_property(p, line)) {
            return fail(err, "%s: bad line in the PLY header: %.60s", p->path, line);
        }
    }
    return fail(err, "%s: the PLY header has no end", p->path);
}

/* --- Values --- */

static bool read_text(ply *p, double *out)
{
    char *stop;
    *out = strtod(p->at, &stop); /* file_read put a 0 behind the data */
    if (stop == p->at || stop > p->end)
        return false;
    p->at = stop;
    return true;
}

static bool read_value(ply *p, value_type type, double *out)
{
    uint32_t size = value_types[type].size;
    unsigned char b[8] = {0};
    uint64_t bits = 0;
    if (p->text)
        return read_text(p, out);
    if ((size_t)(p->end - p->at) < size)
        return false;
    memcpy(b, p->at, size);
    p->at += size;
    for (uint32_t i = 0; i < size; i++)
        bits |= (uint64_t)b[p->big_endian ? size - 1 - i : i] << (8 * i);
    if (type == FLOAT64) {
        memcpy(out, &bits, sizeof *out);
    } else if (type == FLOAT32) {
        uint32_t low = (uint32_t)bits;
        float f;
        memcpy(&f, &low, sizeof f);
        *out = f;
    } else {
        bool is_signed = type == INT8 || type == INT16 || type == INT32;
        double range = (double)(UINT64_C(1) << (8 * size)), x = (double)bits;
        *out = is_signed && x >= 0.5 * range ? x - range : x;
    }
    return true;
}

static void add_triangle(ply *p, uint32_t a, uint32_t b, uint32_t c)
{
    size_t used = 3 * (size_t)p->m.triangle_count;
    if (used + 3 > p->index_capacity) {
        p->index_capacity = 2 * p->index_capacity + 384;
        p->m.indices = xrealloc(p->m.indices, p->index_capacity * sizeof *p->m.indices);
    }
    p->m.indices[used] = a;
    p->m.indices[used + 1] = b;
    p->m.indices[used + 2] = c;
    p->m.triangle_count++;
}

/* Polygons become fans. */
static bool read_list(ply *p, const property *q)
{
    double count, x;
    uint32_t first = 0, last = 0;
    if (!read_value(p, q->count_type, &count) || !(count >= 0.0))
        return false;
    for (double i = 0.0; i < count; i += 1.0) {
        if (!read_value(p, q->type, &x))
            return false;
        if (!q->is_indices)
            continue;
        if (!(x >= 0.0 && x <= (double)UINT32_MAX))
            return false;
        if (i == 0.0)
            first = (uint32_t)x;
        if (i >= 2.0)
            add_triangle(p, first, last, (uint32_t)x);
        last = (uint32_t)x;
    }
    return true;
}

/* --- Elements --- */

static void new_vertices(ply *p, const element *e)
{
    size_t n = (size_t)e->count;
    p->m.vertex_count = (uint32_t)n;
    p->m.positions = xcalloc(1, 3 * n * sizeof(float) + VERTEX_PADDING);
    if ((e->slots >> ROW_NORMAL & 7u) == 7u)
        p->m.normals = xcalloc(n, 3 * sizeof(float));
    if ((e->slots >> ROW_UV & 3u) == 3u)
        p->m.uvs = xcalloc(n, 2 * sizeof(float));
}

static void set_vertex(mesh *m, size_t i, const float row[ROW_SIZE])
{
    memcpy(m->positions + 3 * i, row + ROW_POSITION, 3 * sizeof *row);
    if (m->normals && isfinite(row[ROW_NORMAL] + row[ROW_NORMAL + 1] + row[ROW_NORMAL + 2]))
        memcpy(m->normals + 3 * i, row + ROW_NORMAL, 3 * sizeof *row);
    if (m->uvs && isfinite(row[ROW_UV] + row[ROW_UV + 1])) {
        m->uvs[2 * i] = row[ROW_UV];
        m->uvs[2 * i + 1] = 1.0f - row[ROW_UV + 1]; /* the format counts from the bottom */
    }
}

static bool read_element(ply *p, const element *e, message *err)
{
    bool is_vertex = strcmp(e->name, "vertex") == 0;
    if (e->property_count == 0)
        return true;
    /* Every value takes at least one byte: a wrong count must not claim memory. */
    if (e->count > (uint64_t)(p->end - p->at) || e->count > UINT32_MAX)
        return fail(err, "%s: the file is too short for its %llu %.31s elements", p->path, (unsigned long long)e->count,
                    e->name);
    if (is_vertex && (p->m.positions || (e->slots & 7u) != 7u))
        return fail(err, "%s: vertices without x, y and z, or twice", p->path);
    if (is_vertex)
        new_vertices(p, e);
    for (size_t i = 0; i < e->count; i++) {
        float row[ROW_SIZE] = {0};
        double x = 0.0;
        for (uint32_t k = 0; k < e->property_count; k++) {
            const property *q = &e->properties[k];
            if (q->is_list ? !read_list(p, q) : !read_value(p, q->type, &x))
                return fail(err, "%s: %.31s %zu is damaged or cut off", p->path, e->name, i);
            row[q->slot] = (float)x;
        }
        if (is_vertex)
            set_vertex(&p->m, i, row);
    }
    return true;
}

bool ply_read(const char *path, scene *s, message *err)
{
    char *data;
    size_t size;
    if (!file_read(path, &data, &size, err))
        return false;
    ply p = {.path = path, .at = data, .end = data + size};
    bool ok = read_header(&p, err);
    for (uint32_t i = 0; ok && i < p.element_count; i++)
        ok = read_element(&p, &p.elements[i], err);
    free(data);
    p.m.material = scene_add_material(s, default_material());
    uint32_t index = scene_add_mesh(s, p.m);
    instance placed = {.mesh = index};
    memcpy(placed.to_world, transform_identity, sizeof placed.to_world);
    scene_add_instance(s, placed);
    return ok;
}
