// Products over events and the time loop of a layer of integrate-and-fire neurons, for one thread.
//
// All matrices are float32, row-major, and `width` columns wide: a multiple of PAD, the last columns zero.
// Rows of a sequence are (step, batch) pairs, step first. Events are rows of (index, value) pairs: those of row
// r are first[r] .. first[r + 1]. A value pointer may be null: every event is then a spike, of value 1.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#if defined(__GLIBC__)
#include <malloc.h>
#endif
#if defined(__AVX512F__)
#include <immintrin.h>
#endif

#if defined(__AVX512F__)
constexpr int LANES = 16, TILE_ROWS = 8;
#elif defined(__AVX__)
constexpr int LANES = 8, TILE_ROWS = 4;
#elif defined(__aarch64__)
constexpr int LANES = 4, TILE_ROWS = 8;
#else
constexpr int LANES = 4, TILE_ROWS = 4;
#endif
constexpr int PANEL = 2;                      // vectors: a panel of a 256 x 256 matrix then fits the first-level cache
constexpr int GATHERED = LANES == 16 ? 4 : 8;  // vectors: rows of a panel of 128 rows then stay in that cache
constexpr int BLOCK = 128;                    // rows taken at a time

typedef float Vector __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

static inline Vector load(const float *p) { return *reinterpret_cast<const Vector *>(p); }
static inline void store(float *p, Vector v) { *reinterpret_cast<Vector *>(p) = v; }

// out[0 .. N * LANES) = start + sum of value * matrix[index], the sum held in registers.
template <int N>
static inline void gather(const int32_t *index, const float *value, long events, const float *matrix, long width,
                          const float *start, float *out) {
    Vector sum[N];
    for (int n = 0; n < N; n++) sum[n] = load(start + n * LANES);
    if (value) {
        for (long e = 0; e < events; e++) {
            const float *row = matrix + index[e] * width;
            const Vector factor = value[e] - Vector{};
            for (int n = 0; n < N; n++) sum[n] += factor * load(row + n * LANES);
        }
    } else {
        for (long e = 0; e < events; e++) {
            const float *row = matrix + index[e] * width;
            for (int n = 0; n < N; n++) sum[n] += load(row + n * LANES);
        }
    }
    for (int n = 0; n < N; n++) store(out + n * LANES, sum[n]);
}

// Calls work(N, c) for panels of N vectors that start at column c, as wide as they can be.
template <int N, class Work>
static inline void each_panel(long width, const Work &work, long c = 0) {
    for (; c + N * LANES <= width; c += N * LANES) work(std::integral_constant<int, N>{}, c);
    if constexpr (N > 1) each_panel<N / 2>(width, work, c);
}

static void add_rows(const int32_t *index, long events, const float *matrix, long width, float *out) {
    constexpr int MOST = LANES == 16 ? 16 : 8;
    each_panel<MOST>(width, [&](auto n, long c) {
        gather<n>(index, nullptr, events, matrix + c, width, out + c, out + c);
    });
}

// The panels of a matrix one after the other, each with its rows side by side.
template <int N>
static void pack(const float *matrix, long rows, long width, std::vector<float> &packed) {
    packed.resize(rows * width);
    each_panel<N>(width, [&](auto n, long c) {
        constexpr long columns = n * LANES;
        for (long k = 0; k < rows; k++)
            std::memcpy(&packed[c * rows + k * columns], matrix + k * width + c, columns * sizeof(float));
    });
}

// out = left (rows x inner, pitch) times a panel (inner x N * LANES, packed).
template <int ROWS, int N>
static inline void tile(const float *left, long pitch, const float *panel, long inner, float *out, long width) {
    Vector sum[ROWS][N] = {};
    for (long k = 0; k < inner; k++) {
        Vector right[N];
        for (int n = 0; n < N; n++) right[n] = load(panel + (k * N + n) * LANES);
        for (int r = 0; r < ROWS; r++)
            for (int n = 0; n < N; n++) sum[r][n] += (left[r * pitch + k] - Vector{}) * right[n];
    }
    for (int r = 0; r < ROWS; r++)
        for (int n = 0; n < N; n++) store(out + r * width + n * LANES, sum[r][n]);
}

static void multiply(const float *left, long rows, long pitch, const std::vector<float> &packed, long inner,
                     long width, float *out) {
    each_panel<PANEL>(width, [&](auto n, long c) {
        const float *panel = &packed[c * inner];
        long r = 0;
        for (; r + TILE_ROWS <= rows; r += TILE_ROWS)
            tile<TILE_ROWS, n>(left + r * pitch, pitch, panel, inner, out + r * width + c, width);
        for (; r < rows; r++) tile<1, n>(left + r * pitch, pitch, panel, inner, out + r * width + c, width);
    });
}

// Columns, and values if wanted, of the entries of a row that are not zero; there is room for LANES more of them.
static inline long find(const float *row, long columns, int32_t *index, float *value) {
    long n = 0, c = 0;
#if defined(__AVX512F__)
    const __m512i lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for (; c + LANES <= columns; c += LANES) {
        const __m512 x = _mm512_loadu_ps(row + c);
        const __mmask16 found = _mm512_cmp_ps_mask(x, _mm512_setzero_ps(), _CMP_NEQ_UQ);
        const __m512i column = _mm512_add_epi32(lanes, _mm512_set1_epi32(c));
        _mm512_storeu_si512(index + n, _mm512_maskz_compress_epi32(found, column));
        if (value) _mm512_storeu_ps(value + n, _mm512_maskz_compress_ps(found, x));
        n += __builtin_popcount(found);
    }
#endif
    for (; c < columns; c++) {
        index[n] = c;
        if (value) value[n] = row[c];
        n += row[c] != 0.0f;
    }
    return n;
}

// exp(x) for x <= 0 within 2e-7 of relative error, in a form that compilers vectorise.
static inline float exp_negative(float x) {
    const float y = (x < -87.0f ? -87.0f : x) * 1.44269504f;
    const float whole = std::floor(y + 0.5f);
    const float f = y - whole;
    float p = 1.5403530e-4f;
    p = p * f + 1.3333558e-3f;
    p = p * f + 9.6181291e-3f;
    p = p * f + 5.5504109e-2f;
    p = p * f + 2.4022651e-1f;
    p = p * f + 6.9314718e-1f;
    p = p * f + 1.0f;
    const int32_t bits = (static_cast<int32_t>(whole) + 127) << 23;
    float power;
    std::memcpy(&power, &bits, sizeof power);
    return p * power;
}

struct Gaussian {
    static inline float slope(float d) { return 0.398942280f * exp_negative(-0.5f * d * d); }
};
struct FastSigmoid {
    static inline float slope(float d) { const float r = 1.0f / (1.0f + std::fabs(d)); return r * r; }
};
struct Triangle {
    static inline float slope(float d) { const float h = 1.0f - std::fabs(d); return h > 0.0f ? h : 0.0f; }
};
struct Arctan {
    static inline float slope(float d) { return 1.0f / (1.0f + d * d); }
};

struct Rule {
    float floor, scale, width;
    int32_t subtract, reset_gradient, surrogate;
};

// One step backwards for one row: grad (of the current) from the gradient of the spikes and of the next step.
template <class Surrogate>
static inline void step_back(const Rule &rule, long width, const float *__restrict decay, const float *__restrict v,
                             const float *__restrict grad_s, const float *__restrict recurrent,
                             const float *__restrict next, float *__restrict grad, float *__restrict grad_decay) {
    const float keep = rule.subtract ? 1.0f : 0.0f, through = rule.reset_gradient ? 1.0f : 0.0f;
    const float scale = rule.scale / rule.width, inverse = 1.0f / rule.width, floor = rule.floor;
    for (long h = 0; h < width; h++) {
        const float slope = scale * Surrogate::slope((v[h] - 1.0f) * inverse);
        const float s = v[h] > 1.0f ? 1.0f : 0.0f;
        const float kept = 1.0f - s * (1.0f - keep);  // d carry / d v at a fixed spike
        const float reset = keep + (1.0f - keep) * v[h];
        const float carry = v[h] * kept - keep * s;
        const float g = next[h] * decay[h] * (kept - through * reset * slope) + (grad_s[h] + recurrent[h]) * slope;
        grad_decay[h] += next[h] * carry;
        grad[h] = v[h] > floor ? g : 0.0f;
    }
}

extern "C" {

// Every step needs the same few buffers of some megabytes; without this glibc gives them back to the system and asks
// for them again, which costs up to a quarter of the time in page faults.
void kernel_keep_memory() {
#if defined(__GLIBC__)
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 512 << 20);
#endif
}

int32_t kernel_pad() { return std::max(16, PANEL * LANES); }

// Entries that the rows of events need room for beyond what they hold.
int32_t kernel_room() { return LANES; }

// Events of a dense matrix; index and value have room for all entries, and kernel_room more.
void kernel_events(const float *x, int64_t rows, int64_t columns, int32_t *first, int32_t *index, float *value) {
    int32_t n = 0;
    for (long r = 0; r < rows; r++) {
        first[r] = n;
        n += find(x + r * columns, columns, index + n, value + n);
    }
    first[rows] = n;
}

// out (rows x width) = start (width) + events times matrix (columns x width).
void kernel_product(const int32_t *first, const int32_t *index, const float *value, int64_t rows, int64_t columns,
                    const float *matrix, int64_t width, const float *start, float *out) {
    std::vector<float> packed;
    pack<GATHERED>(matrix, columns, width, packed);
    for (long low = 0; low < rows; low += BLOCK) {
        const long high = std::min<long>(low + BLOCK, rows);
        each_panel<GATHERED>(width, [&](auto n, long c) {
            for (long r = low; r < high; r++)
                gather<n>(index + first[r], value ? value + first[r] : nullptr, first[r + 1] - first[r],
                          &packed[c * columns], n * LANES, start + c, out + r * width + c);
        });
    }
}

// out (rows x width) = left (rows x inner, pitch) times matrix (inner x width).
void kernel_dense_product(const float *left, int64_t rows, int64_t pitch, const float *matrix, int64_t inner,
                          int64_t width, float *out) {
    std::vector<float> packed;
    pack<PANEL>(matrix, inner, width, packed);
    for (long r = 0; r < rows; r += BLOCK)
        multiply(left + r * pitch, std::min<long>(BLOCK, rows - r), pitch, packed, inner, width, out + r * width);
}

// out (columns x width) += transposed events times grad (rows x width), a block of rows at a time, sorted by column.
void kernel_outer(const int32_t *first, const int32_t *index, const float *value, int64_t rows, int64_t columns,
                  const float *grad, int64_t width, float *out) {
    std::vector<int32_t> start(columns + 1), place(columns), source;
    std::vector<float> factor, packed;
    for (long low = 0; low < rows; low += BLOCK) {
        const long high = std::min<long>(low + BLOCK, rows);
        const int32_t *column = index + first[low];
        const long events = first[high] - first[low];
        std::fill(start.begin(), start.end(), 0);
        for (long e = 0; e < events; e++) start[column[e] + 1]++;
        for (long c = 0; c < columns; c++) start[c + 1] += start[c];
        std::copy(start.begin(), start.end() - 1, place.begin());
        source.resize(events);
        if (value) factor.resize(events);
        for (long r = low; r < high; r++)
            for (int32_t e = first[r]; e < first[r + 1]; e++) {
                const int32_t p = place[index[e]]++;
                source[p] = r - low;
                if (value) factor[p] = value[e];
            }
        pack<GATHERED>(grad + low * width, high - low, width, packed);
        each_panel<GATHERED>(width, [&](auto n, long p) {
            const float *panel = &packed[p * (high - low)];
            for (long c = 0; c < columns; c++) {
                float *sum = out + c * width + p;
                if (start[c + 1] > start[c])
                    gather<n>(source.data() + start[c], value ? factor.data() + start[c] : nullptr,
                              start[c + 1] - start[c], panel, n * LANES, sum, sum);
            }
        });
    }
}

// v: currents in, potentials out. s: spikes out, also as events with room for all, and kernel_room more.
// recurrent (width x width): row j is added to the currents of the next step for every spike of neuron j, or null.
void kernel_forward(int64_t steps, int64_t batch, int64_t width, const Rule *rule, const float *decay,
                    const float *recurrent, float *v, float *s, int32_t *first, int32_t *index) {
    int32_t n = 0;
    const float keep = rule->subtract ? 1.0f : 0.0f, floor = rule->floor;
    first[0] = 0;
    for (long r = 0; r < steps * batch; r++) {
        float *now = v + r * width, *out = s + r * width;
        if (r >= batch) {
            const long before = r - batch;
            const float *last = v + before * width, *spiked = s + before * width;
            for (long h = 0; h < width; h++)
                now[h] += decay[h] * (last[h] * (1.0f - spiked[h] * (1.0f - keep)) - keep * spiked[h]);
            if (recurrent)
                add_rows(index + first[before], first[before + 1] - first[before], recurrent, width, now);
        }
        for (long h = 0; h < width; h++) {
            now[h] = now[h] > floor ? now[h] : floor;
            out[h] = now[h] > 1.0f ? 1.0f : 0.0f;
        }
        n += find(out, width, index + n, nullptr);
        first[r + 1] = n;
    }
}

// grad (steps, batch, width): gradient of the currents. matrix (neurons x width): the recurrent weights, or null.
void kernel_backward(int64_t steps, int64_t batch, int64_t width, int64_t neurons, const Rule *rule,
                     const float *decay, const float *matrix, const float *v, const float *grad_s, float *grad,
                     float *grad_decay) {
    const long size = batch * width;
    std::vector<float> packed, recurrent(size), zero(size);
    if (matrix) pack<PANEL>(matrix, neurons, width, packed);
    for (long t = steps - 1; t >= 0; t--) {
        const float *next = t + 1 < steps ? grad + (t + 1) * size : zero.data();
        if (matrix && t + 1 < steps) multiply(next, batch, width, packed, neurons, width, recurrent.data());
        for (long b = 0; b < batch; b++) {
            const long o = t * size + b * width, i = b * width;
#define BACK(S) \
    step_back<S>(*rule, width, decay, v + o, grad_s + o, &recurrent[i], next + i, grad + o, grad_decay)
            switch (rule->surrogate) {
                case 0: BACK(Gaussian); break;
                case 1: BACK(FastSigmoid); break;
                case 2: BACK(Triangle); break;
                default: BACK(Arctan); break;
            }
#undef BACK
        }
    }
}

}  // extern "C"
