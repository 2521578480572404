/* SPDX-License-Identifier: Apache-2.0 */
/* Scattering: Lambert, GGX metal, Lambert under a GGX coat, perfect mirror, smooth glass; texture look-up.
 * GGX after Walter et al. 2007 with the height-correlated Smith term and visible-normal sampling (Heitz 2014, 2018).
 * Local directions have the shading normal as z. */
#include "material.h"

/* Below this roughness a metal is a perfect mirror, and a coat gets no sharper: narrower lobes (alpha < 9e-4) are not
 * resolved by float half vectors. */
#define MIN_ROUGHNESS 0.03f

/* Least probability of the coat, so that its highlights on bright paint are found. */
#define MIN_COAT 0.1f

typedef struct lobe_value {
    rgb f;
    float pdf;
} lobe_value;

bool material_is_specular(const material *m)
{
    return m->kind == MATERIAL_DIELECTRIC || (m->kind == MATERIAL_CONDUCTOR && m->roughness < MIN_ROUGHNESS);
}

/* --- Fresnel --- */

static rgb schlick(rgb f0, float cosine)
{
    float m = float_min(float_max(1.0f - cosine, 0.0f), 1.0f), m5 = m * m * m * m * m;
    return v3(f0.x + (1.0f - f0.x) * m5, f0.y + (1.0f - f0.y) * m5, f0.z + (1.0f - f0.z) * m5);
}

/* Exact, unpolarised. `eta`: index on the far side over that on the near side. *cos_t: cosine of the refracted ray, 0
 * at total internal reflection. */
static float fresnel(float cos_i, float eta, float *cos_t)
{
    float sin2_t = float_max(0.0f, 1.0f - cos_i * cos_i) / (eta * eta);
    *cos_t = 0.0f;
    if (sin2_t >= 1.0f || cos_i <= 0.0f)
        return 1.0f;
    float c = *cos_t = sqrtf(1.0f - sin2_t);
    float parallel = (eta * cos_i - c) / (eta * cos_i + c), perpendicular = (cos_i - eta * c) / (cos_i + eta * c);
    return 0.5f * (parallel * parallel + perpendicular * perpendicular);
}

static float coat_fresnel(float cosine, float ior)
{
    float unused;
    return fresnel(cosine, ior, &unused);
}

/* --- GGX --- */

static float ggx_alpha(const material *m)
{
    float r = float_max(m->roughness, MIN_ROUGHNESS);
    return r * r;
}

/* D, from all three components: 1 - cos^2 would cancel for small alpha. */
static float ggx_d(vec3 h, float alpha)
{
    float t = (h.x * h.x + h.y * h.y) / (alpha * alpha) + h.z * h.z;
    return 1.0f / (PI_F * alpha * alpha * t * t);
}

/* z times (1 + 2 Lambda). */
static float ggx_smith(float z, float alpha)
{
    float a2 = alpha * alpha;
    return sqrtf(a2 + (1.0f - a2) * z * z);
}

/* D G2 / (4 cos cos) and the density of wi under visible-normal sampling; both without division by a cosine. */
static float ggx(vec3 wo, vec3 wi, vec3 h, float alpha, float *pdf)
{
    float d = ggx_d(h, alpha), so = ggx_smith(wo.z, alpha), si = ggx_smith(wi.z, alpha);
    *pdf = 0.5f * d / (wo.z + so);
    return 0.5f * d / (wo.z * si + wi.z * so);
}

/* Heitz 2018, "Sampling the GGX Distribution of Visible Normals". */
static vec3 ggx_visible_normal(vec3 wo, float alpha, float u1, float u2)
{
    vec3 v = v3_normalize(v3(alpha * wo.x, alpha * wo.y, wo.z));
    float length2 = v.x * v.x + v.y * v.y, r = sqrtf(u1), phi = 2.0f * PI_F * u2, s = 0.5f * (1.0f + v.z);
    vec3 t1 = length2 > 0.0f ? v3_scale(v3(-v.y, v.x, 0.0f), 1.0f / sqrtf(length2)) : v3(1.0f, 0.0f, 0.0f);
    vec3 t2 = v3_cross(v, t1);
    float a = r * cosf(phi), b = r * sinf(phi);
    b = (1.0f - s) * sqrtf(float_max(0.0f, 1.0f - a * a)) + s * b;
    vec3 n = v3_mad(v3_add(v3_scale(t1, a), v3_scale(t2, b)), sqrtf(float_max(0.0f, 1.0f - a * a - b * b)), v);
    return v3_normalize(v3(alpha * n.x, alpha * n.y, float_max(1e-6f, n.z)));
}

/* --- Non-specular scattering --- */

static vec3 to_local(vec3 n, vec3 w)
{
    vec3 t, b;
    v3_basis(n, &t, &b);
    return v3(v3_dot(w, t), v3_dot(w, b), v3_dot(w, n));
}

static vec3 to_world(vec3 n, vec3 w)
{
    vec3 t, b;
    v3_basis(n, &t, &b);
    return v3_normalize(v3_mad(v3_mad(v3_scale(t, w.x), w.y, b), w.z, n));
}

/* Probability of the coat in the mixture of a glossy material: its share of the reflectance. */
static float coat_probability(const surface *s, float cos_o)
{
    float f = coat_fresnel(cos_o, s->material->ior), diffuse = (1.0f - f) * float_max(0.0f, v3_max_component(s->color));
    float share = f + diffuse > 0.0f ? f / (f + diffuse) : 1.0f;
    return float_max(MIN_COAT, share);
}

static lobe_value evaluate(const surface *s, vec3 wi_world)
{
    const material *m = s->material;
    lobe_value none = {{0.0f, 0.0f, 0.0f}, 0.0f}, v = none;
    if (m->kind == MATERIAL_DIFFUSE) { /* needs no local directions */
        float cos_i = v3_dot(wi_world, s->normal);
        if (!(cos_i > 0.0f && v3_dot(s->wo, s->normal) > 0.0f) || v3_dot(wi_world, s->geometric_normal) <= 0.0f)
            return none;
        return (lobe_value){v3_scale(s->color, 1.0f / PI_F), cos_i * (1.0f / PI_F)};
    }
    vec3 wo = to_local(s->normal, s->wo), wi = to_local(s->normal, wi_world);
    if (!(wi.z > 0.0f && wo.z > 0.0f) || v3_dot(wi_world, s->geometric_normal) <= 0.0f || material_is_specular(m))
        return none;
    vec3 h = v3_normalize(v3_add(wi, wo));
    if (!(v3_dot(h, h) > 0.5f)) /* opposite directions along the surface */
        return none;
    float coat_pdf, coat = ggx(wo, wi, h, ggx_alpha(m), &coat_pdf), cos_h = v3_dot(wo, h);
    if (m->kind == MATERIAL_CONDUCTOR)
        return (lobe_value){v3_scale(schlick(s->color, cos_h), coat), coat_pdf};

    /* Light enters and leaves the coat once each; what it reflects back inside is lost, which keeps f below 1. */
    float through = (1.0f - coat_fresnel(wi.z, m->ior)) * (1.0f - coat_fresnel(wo.z, m->ior));
    float p = coat_probability(s, wo.z), f = coat * coat_fresnel(cos_h, m->ior);
    v.f = v3_add(v3_scale(s->color, through / PI_F), v3(f, f, f));
    v.pdf = p * coat_pdf + (1.0f - p) * wi.z / PI_F;
    return v;
}

rgb material_eval(const surface *s, vec3 wi)
{
    return evaluate(s, wi).f;
}

rgb material_eval_pdf(const surface *s, vec3 wi, float *pdf)
{
    lobe_value v = evaluate(s, wi);
    *pdf = v.pdf;
    return v.f;
}

float material_pdf(const surface *s, vec3 wi)
{
    return evaluate(s, wi).pdf;
}

rgb material_sample(const surface *s, float u1, float u2, float u3, vec3 *wi, float *pdf)
{
    const material *m = s->material;
    rgb black = v3(0.0f, 0.0f, 0.0f);
    vec3 wo = to_local(s->normal, s->wo), local;
    float coat = m->kind == MATERIAL_CONDUCTOR ? 1.0f : m->kind == MATERIAL_GLOSSY ? coat_probability(s, wo.z) : 0.0f;
    *pdf = 0.0f;
    *wi = s->normal;
    if (!(wo.z > 0.0f) || material_is_specular(m))
        return black;
    if (u3 < coat) {
        vec3 h = ggx_visible_normal(wo, ggx_alpha(m), u1, u2);
        local = v3_sub(v3_scale(h, 2.0f * v3_dot(wo, h)), wo);
    } else {
        float r = sqrtf(u1), phi = 2.0f * PI_F * u2;
        local = v3(r * cosf(phi), r * sinf(phi), sqrtf(float_max(0.0f, 1.0f - u1)));
    }
    *wi = to_world(s->normal, local);
    lobe_value v = evaluate(s, *wi);
    if (!(v.pdf > 0.0f))
        return black;
    *pdf = v.pdf;
    return v3_scale(v.f, v3_dot(s->normal, *wi) / v.pdf);
}

/* --- Specular scattering --- */

static specular_branch reflect(const surface *s, vec3 n, rgb weight)
{
    vec3 wi = v3_normalize(v3_sub(v3_scale(n, 2.0f * v3_dot(n, s->wo)), s->wo));
    return (specular_branch){.wi = wi, .weight = weight, .transmitted = false, .eta = 1.0f};
}

/* False where a branch leaves on the wrong side of the surface: the shading normal is too far off. */
static bool branches_about(const surface *s, vec3 n, specular_branch out[2], int *count)
{
    const material *m = s->material;
    float cos_i = float_min(1.0f, v3_dot(n, s->wo)), cos_t;
    *count = 0;
    if (m->kind == MATERIAL_CONDUCTOR) {
        out[(*count)++] = reflect(s, n, schlick(s->color, cos_i));
        return v3_dot(out[0].wi, s->geometric_normal) > 0.0f;
    }
    float eta = s->back_side ? 1.0f / m->ior : m->ior, f = fresnel(cos_i, eta, &cos_t);
    if (f > 0.0f) {
        out[(*count)++] = reflect(s, n, v3(f, f, f));
        if (v3_dot(out[0].wi, s->geometric_normal) <= 0.0f)
            return false;
    }
    if (f < 1.0f) {
        vec3 wi = v3_normalize(v3_mad(v3_scale(s->wo, -1.0f / eta), cos_i / eta - cos_t, n));
        out[(*count)++] = (specular_branch){wi, v3_scale(s->color, 1.0f - f), true, eta};
        return v3_dot(wi, s->geometric_normal) < 0.0f;
    }
    return true;
}

/* The weight of a refraction is (1 - F) color, without the 1/eta^2 by which radiance is compressed in the denser
 * medium. Paths start and end outside of the glass, where the factors of entering and leaving cancel; without them
 * every branch sum is 1 for white glass, importance and radiance scatter alike, and a closed furnace stays 1 inside as
 * well. */
int material_specular(const surface *s, specular_branch branches[2])
{
    int count = 0;
    if (!material_is_specular(s->material))
        return 0;
    if (!branches_about(s, s->normal, branches, &count))
        branches_about(s, s->geometric_normal, branches, &count);
    return count;
}

bool material_specular_sample(const surface *s, rng *r, rgb *throughput, specular_branch *out)
{
    specular_branch b[2];
    int count = material_specular(s, b);
    float first = count > 0 ? luminance(b[0].weight) : 0.0f;
    float all = first + (count > 1 ? luminance(b[1].weight) : 0.0f);
    if (!(all > 0.0f))
        return false;
    *out = b[count > 1 && rng_float(r) * all >= first];
    *throughput = v3_scale(v3_mul(*throughput, out->weight), all / luminance(out->weight));
    return true;
}

/* --- Summaries --- */

rgb material_diffuse_albedo(const surface *s)
{
    bool none = s->material->kind == MATERIAL_CONDUCTOR || s->material->kind == MATERIAL_DIELECTRIC;
    return none ? v3(0.0f, 0.0f, 0.0f) : s->color;
}

float material_reflectance(const surface *s)
{
    float cos_o = v3_dot(s->normal, s->wo), color = v3_max_component(s->color), r = color, f;
    switch (s->material->kind) {
    case MATERIAL_CONDUCTOR:
        r = v3_max_component(schlick(s->color, cos_o));
        break;
    case MATERIAL_DIELECTRIC:
        f = coat_fresnel(cos_o, s->back_side ? 1.0f / s->material->ior : s->material->ior);
        r = f + (1.0f - f) * color;
        break;
    case MATERIAL_GLOSSY:
        f = coat_fresnel(cos_o, s->material->ior);
        r = f + (1.0f - f) * color;
        break;
    case MATERIAL_DIFFUSE:
        break;
    }
    return float_min(float_max(r, 0.0f), 1.0f);
}

/* --- Textures --- */

/* sRGB to linear (IEC 61966-2-1) of each byte. */
static const float srgb_linear[256] = {
    0.0f,         0.000303527f, 0.000607054f, 0.000910581f, 0.001214108f, 0.001517635f, 0.001821162f, 0.002124689f,
    0.002428216f, 0.002731743f, 0.00303527f,  0.003346536f, 0.003676507f, 0.004024717f, 0.004391442f, 0.004776953f,
    0.005181517f, 0.005605392f, 0.006048833f, 0.006512091f, 0.00699541f,  0.007499032f, 0.008023193f, 0.008568126f,
    0.009134059f, 0.009721217f, 0.01032982f,  0.01096009f,  0.01161225f,  0.01228649f,  0.01298303f,  0.01370208f,
    0.01444384f,  0.01520851f,  0.01599629f,  0.01680738f,  0.01764195f,  0.01850022f,  0.01938236f,  0.02028856f,
    0.02121901f,  0.02217388f,  0.02315337f,  0.02415763f,  0.02518686f,  0.02624122f,  0.02732089f,  0.02842604f,
    0.02955683f,  0.03071344f,  0.03189603f,  0.03310477f,  0.03433981f,  0.03560131f,  0.03688945f,  0.03820437f,
    0.03954624f,  0.0409152f,   0.04231141f,  0.04373503f,  0.0451862f,   0.04666509f,  0.04817182f,  0.04970657f,
    0.05126946f,  0.05286065f,  0.05448028f,  0.05612849f,  0.05780543f,  0.05951124f,  0.06124605f,  0.06301002f,
    0.06480327f,  0.06662594f,  0.06847817f,  0.0703601f,   0.07227185f,  0.07421357f,  0.07618538f,  0.07818742f,
    0.08021982f,  0.08228271f,  0.08437621f,  0.08650046f,  0.08865559f,  0.09084171f,  0.09305896f,  0.09530747f,
    0.09758735f,  0.09989873f,  0.1022417f,   0.1046165f,   0.1070231f,   0.1094617f,   0.1119324f,   0.1144354f,
    0.1169707f,   0.1195384f,   0.1221388f,   0.1247718f,   0.1274377f,   0.1301365f,   0.1328683f,   0.1356333f,
    0.1384316f,   0.1412633f,   0.1441285f,   0.1470273f,   0.1499598f,   0.1529262f,   0.1559265f,   0.1589608f,
    0.1620294f,   0.1651322f,   0.1682694f,   0.1714411f,   0.1746474f,   0.1778884f,   0.1811642f,   0.184475f,
    0.1878208f,   0.1912017f,   0.1946178f,   0.1980693f,   0.2015563f,   0.2050787f,   0.2086369f,   0.2122308f,
    0.2158605f,   0.2195262f,   0.223228f,    0.2269659f,   0.23074f,     0.2345506f,   0.2383976f,   0.2422811f,
    0.2462013f,   0.2501583f,   0.2541521f,   0.2581829f,   0.2622507f,   0.2663556f,   0.2704978f,   0.2746773f,
    0.2788943f,   0.2831487f,   0.2874408f,   0.2917706f,   0.2961383f,   0.3005438f,   0.3049873f,   0.3094689f,
    0.3139887f,   0.3185468f,   0.3231432f,   0.3277781f,   0.3324515f,   0.3371636f,   0.3419144f,   0.3467041f,
    0.3515326f,   0.3564001f,   0.3613068f,   0.3662526f,   0.3712377f,   0.3762621f,   0.381326f,    0.3864294f,
    0.3915725f,   0.3967552f,   0.4019778f,   0.4072402f,   0.4125426f,   0.4178851f,   0.4232677f,   0.4286905f,
    0.4341536f,   0.4396572f,   0.4452012f,   0.4507858f,   0.456411f,    0.462077f,    0.4677838f,   0.4735315f,
    0.4793202f,   0.4851499f,   0.4910208f,   0.496933f,    0.5028865f,   0.5088813f,   0.5149177f,   0.5209956f,
    0.5271151f,   0.5332764f,   0.5394795f,   0.5457245f,   0.5520114f,   0.5583404f,   0.5647115f,   0.5711248f,
    0.5775804f,   0.5840784f,   0.5906188f,   0.5972018f,   0.6038273f,   0.6104956f,   0.6172066f,   0.6239604f,
    0.6307571f,   0.6375969f,   0.6444797f,   0.6514056f,   0.6583748f,   0.6653873f,   0.6724432f,   0.6795425f,
    0.6866853f,   0.6938718f,   0.7011019f,   0.7083758f,   0.7156935f,   0.7230551f,   0.7304607f,   0.7379104f,
    0.7454042f,   0.7529422f,   0.7605245f,   0.7681511f,   0.7758222f,   0.7835378f,   0.7912979f,   0.7991027f,
    0.8069523f,   0.8148466f,   0.8227858f,   0.8307699f,   0.838799f,    0.8468732f,   0.8549926f,   0.8631572f,
    0.8713671f,   0.8796224f,   0.8879231f,   0.8962694f,   0.9046612f,   0.9130987f,   0.9215819f,   0.9301109f,
    0.9386857f,   0.9473065f,   0.9559734f,   0.9646862f,   0.9734453f,   0.9822506f,   0.9911021f,   1.0f};

static rgb texel(const texture *t, uint32_t x, uint32_t y)
{
    const uint8_t *p = t->rgba + 4 * ((size_t)y * t->width + x);
    return v3(srgb_linear[p[0]], srgb_linear[p[1]], srgb_linear[p[2]]);
}

/* Position among n texels whose centres lie at (i + 1/2) / n, repeated: the texel before, the one after, the weight of
 * the latter. */
static float wrap(float x, uint32_t n, uint32_t *before, uint32_t *after)
{
    float f = x - floorf(x), i;
    if (!(f >= 0.0f)) /* not a number, infinite */
        f = 0.0f;
    f = f * (float)n + (float)n - 0.5f;
    i = floorf(f);
    *before = (uint32_t)i % n;
    *after = (*before + 1) % n;
    return f - i;
}

/* Bilinear. */
rgb texture_lookup(const texture *t, float u, float v)
{
    uint32_t x0, x1, y0, y1;
    if (t->width == 0 || t->height == 0)
        return v3(1.0f, 1.0f, 1.0f);
    float a = wrap(u, t->width, &x0, &x1), b = wrap(v, t->height, &y0, &y1);
    rgb low = v3_mad(v3_scale(texel(t, x0, y0), 1.0f - a), a, texel(t, x1, y0));
    rgb high = v3_mad(v3_scale(texel(t, x0, y1), 1.0f - a), a, texel(t, x1, y1));
    return v3_mad(v3_scale(low, 1.0f - b), b, high);
}
