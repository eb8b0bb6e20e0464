/* Runs of a model and their sensitivities, LANES pairs of member and run at a time. march.py writes what precedes this:
the model's own functions `step`, `slopes`, `shown`, `shown_slopes`, and the sizes and places in capitals.

S states, N equations, P coefficients, C channels, U signals of an interval, Q numbers that a sample comes with, TH numbers
of the model that the coefficients move, ND of their derivatives that are not zero. COUNTED angles are not wrapped. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "xla/ffi/api/c_api.h"

#define Z (START ? S : 0)
/* columns of the sensitivities and, last, the error; rows are filled up with zeros to whole fours */
#define W (P + Z + 1)
#define X ((W + 3) / 4 * 4)
#define NN (N * N)
#define TURN 6.283185307179586
#define TABLES 6
#define TERMS 10
#define DOUBLINGS 12

typedef struct {
    const double *other, *linear, *start, *nodes, *seen, *h, *d_other, *d_linear, *spread;
    int64_t members, runs, samples, apart;
    double *found;
} Given;

/* c = a b, and where p > 0 its derivatives by the coefficients, which come last */
static void product(const V *a, const V *da, const V *b, const V *db, V *c, V *dc, int p) {
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            V sum = {0}, *to = dc + (i * N + j) * p;
            for (int q = 0; q < p; q++) to[q] = (V){0};
            for (int k = 0; k < N; k++) {
                const V left = a[i * N + k], right = b[k * N + j];
                const V *d_left = da + (i * N + k) * p, *d_right = db + (k * N + j) * p;
                sum += left * right;
                for (int q = 0; q < p; q++) to[q] += d_left[q] * right + left * d_right[q];
            }
            c[i * N + j] = sum;
        }
}

static void add(V *to, const V *from, double by, int count) {
    for (int i = 0; i < count; i++) to[i] += from[i] * by;
}

static void scale(V *to, double by, int count) {
    for (int i = 0; i < count; i++) to[i] *= by;
}

/* The phi functions of twice the matrix from those of it, M one after the other, and their derivatives dM, as doubled in
simulate/exponential.py. `room` is for 4 more of each. */
static void doubled(V *M, V *dM, V *room, int p) {
    static const double by[4][4] = {{0, 0, 0, 0}, {0, 1, 0, 0}, {0, 1, 1, 0}, {0, 0.5, 1, 1}}, half[4] = {1, 0.5, 0.25, 0.125};
    const int all = NN * p;
    V *next = room, *d_next = room + 4 * NN;
    for (int k = 0; k < 4; k++) product(M, dM, M + k * NN, dM + k * all, next + k * NN, d_next + k * all, p);
    for (int k = 1; k < 4; k++)
        for (int j = 1; j < 4; j++)
            if (by[k][j] != 0.0) {
                add(next + k * NN, M + j * NN, by[k][j], NN);
                add(d_next + k * all, dM + j * all, by[k][j], all);
            }
    for (int k = 0; k < 4; k++) {
        scale(next + k * NN, half[k], NN);
        scale(d_next + k * all, half[k], all);
    }
    memcpy(M, next, 4 * NN * sizeof(V));
    memcpy(dM, d_next, 4 * all * sizeof(V));
}

/* The phi functions of linear times h, as phi_functions in simulate/exponential.py; M holds them one after the other,
dM their derivatives. `room` is for 7 more of each. */
static void phi(const V *linear, const V *d_linear, double h, V *M, V *dM, V *room, int p) {
    const int all = NN * p;
    V *small = room, *term = room + NN, *next = room + 2 * NN;
    V *d_small = room + 3 * NN, *d_term = d_small + all, *d_next = d_term + all, *rest = d_next + all;
    double factorial = 1.0;
    for (int i = 0; i < NN; i++) small[i] = linear[i] * (h / (1 << DOUBLINGS));
    for (int i = 0; i < all; i++) d_small[i] = d_linear[i] * (h / (1 << DOUBLINGS));
    memset(dM, 0, 4 * all * sizeof(V));
    memset(d_term, 0, all * sizeof(V));
    for (int k = 0; k < 4; k++) {
        if (k > 1) factorial *= k;
        for (int i = 0; i < NN; i++) M[k * NN + i] = v_same(i % (N + 1) == 0 ? 1.0 / factorial : 0.0);
    }
    memcpy(term, M, NN * sizeof(V));
    for (int j = 1; j < TERMS; j++) {
        product(term, d_term, small, d_small, next, d_next, p);
        for (int i = 0; i < NN; i++) term[i] = next[i] / (double)j;
        for (int i = 0; i < all; i++) d_term[i] = d_next[i] / (double)j;
        double share = 1.0;
        for (int k = 0; k < 4; k++) {
            if (k > 0) share /= j + k;
            add(M + k * NN, term, share, NN);
            add(dM + k * all, d_term, share, all);
        }
    }
    for (int s = 0; s < DOUBLINGS; s++) doubled(M, dM, rest, p);
}

/* weights of the scheme: full, half, stage, first, middle, last, as step_table */
static void weigh(const V *phis, double h, V *T, int count) {
    const V *p1 = phis + count, *p2 = phis + 2 * count, *p3 = phis + 3 * count;
    for (int i = 0; i < count; i++) {
        T[i] = phis[i];
        T[3 * count + i] = (p1[i] - 3.0 * p2[i] + 4.0 * p3[i]) * h;
        T[4 * count + i] = (2.0 * p2[i] - 4.0 * p3[i]) * h;
        T[5 * count + i] = (4.0 * p3[i] - p2[i]) * h;
    }
}

static void tables(const V *linear, const V *d_linear, double h, V *T, V *dT, V *room, int p) {
    const int all = NN * p;
    V *phis = room, *d_phis = room + 4 * NN, *more = d_phis + 4 * all;
    phi(linear, d_linear, 0.5 * h, phis, d_phis, more, p);
    memcpy(T + NN, phis, NN * sizeof(V));
    memcpy(dT + all, d_phis, all * sizeof(V));
    for (int i = 0; i < NN; i++) T[2 * NN + i] = phis[NN + i] * (0.5 * h);
    for (int i = 0; i < all; i++) dT[2 * all + i] = d_phis[all + i] * (0.5 * h);
    doubled(phis, d_phis, more, p);
    weigh(phis, h, T, NN);
    weigh(d_phis, h, dT, all);
}

/* number i of `width` that the member, or the run, of each lane has */
static void load(V *to, const double *from, const int64_t *row, int64_t width) {
    int same = 1;
    EACH(l) same &= row[l] == row[0];
    if (same)
        for (int64_t i = 0; i < width; i++) to[i] = v_same(from[row[0] * width + i]);
    else
        for (int64_t i = 0; i < width; i++) EACH(l) to[i][l] = from[row[l] * width + i];
}

/* to[row, j] = sum of value * from[place, j] over the row's places; four columns at once stay in registers */
static inline void apply(V *to, int rows, const int *begin, const int *place, const V *value, const V *from) {
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < X; j += 4) {
            V sum[4] = {{0}, {0}, {0}, {0}};
            for (int e = begin[i]; e < begin[i + 1]; e++) {
                const V by = value[e], *other = from + place[e] * X + j;
#pragma GCC unroll 4
                for (int q = 0; q < 4; q++) sum[q] += by * other[q];
            }
            memcpy(to + i * X + j, sum, sizeof sum);
        }
}

static void scatter(V *to, int rows, const int *begin, const int *place, const V *value) {
    for (int i = 0; i < rows; i++)
        for (int e = begin[i]; e < begin[i + 1]; e++) to[i * X + place[e]] += value[e];
}

/* adds the products of the columns a and a + 1 with those from a on to `gram` */
static inline void multiply_two(V *gram, const V *columns, int a) {
    V left[2][C];
    for (int c = 0; c < C; c++) {
        left[0][c] = columns[c * X + a];
        left[1][c] = columns[c * X + a + 1];
    }
    for (int b = a; b < W; b++) {
        V first = gram[a * X + b], second = gram[(a + 1) * X + b];
#pragma GCC unroll 16
        for (int c = 0; c < C; c++) {
            const V right = columns[c * X + b];
            first += left[0][c] * right;
            second += left[1][c] * right;
        }
        gram[a * X + b] = first;
        gram[(a + 1) * X + b] = second;
    }
}

/* What a block works in; a size that may be none has one more. */
typedef struct {
    V weights[TABLES * NN], d_weights[TABLES * NN * P + 1], linear[NN], d_linear[NN * P + 1], phi[11 * NN * (1 + P)];
    V other[TO + 1], th[TH + 1], D[ND + 1];
    V x[S], next[S], u[U], seen[Q], error[C];
    V a[NA + 1], b[NB + 1], c[NC + 1], direct[NX + 1];
    V by[S * X], by_next[S * X], shown_by[C * X], gram[X * X];
    V turns[C];
    unsigned char met[C][LANES];
} Room;

/* Which pairs of member and run the lanes of a block take: one run of many members where there are enough, so that what
belongs to a run is the same in every lane, and the members the same from run to run. The last block repeats its last. */
static int64_t blocks(const Given *g) {
    const int64_t total = g->members * g->runs;
    return g->members < LANES ? (total + LANES - 1) / LANES : (g->members + LANES - 1) / LANES * g->runs;
}

static int deal(const Given *g, int64_t block, int64_t *member, int64_t *run) {
    const int few = g->members < LANES;
    const int64_t first = (few ? block : block / g->runs) * LANES, total = few ? g->members * g->runs : g->members;
    EACH(l) {
        const int64_t at = first + l < total ? first + l : total - 1;
        member[l] = few ? at / g->runs : at;
        run[l] = few ? at % g->runs : block % g->runs;
    }
    return total - first < LANES ? (int)(total - first) : LANES;
}

/* The numbers of each lane's member, and with `columns` their derivatives. */
static void prepare(const Given *g, const int64_t *member, int columns, Room *r) {
    load(r->other, g->other, member, TO);
    load(r->linear, g->linear, member, NN);
    if (columns) load(r->d_linear, g->d_linear, member, NN * P);
    tables(r->linear, r->d_linear, g->h[0], r->weights, r->d_weights, r->phi, columns ? P : 0);
    for (int t = 0; t < TH; t++) r->th[t] = TH_FROM[t] >= 0 ? r->other[TH_FROM[t]] : r->weights[-1 - TH_FROM[t]];
    for (int t = 0; columns && t < ND; t++) {
        if (D_FROM[t] < 0) r->D[t] = r->d_weights[-1 - D_FROM[t]];
        else EACH(l) r->D[t][l] = g->d_other[member[l] * NDO + D_FROM[t]];
    }
}

/* Of an angle whose turns are counted, those by which the first sample that was measured is off are no error. */
static void count(Room *r) {
    for (int i = 0; i < C; i++) {
        if (!COUNTED[i]) continue;
        const V turn = r->seen[Q - C + i] * TURN;
        EACH(l) if (!r->met[i][l] && turn[l] != 0.0) {
            r->met[i][l] = 1;
            r->turns[i][l] = nearbyint(r->error[i][l] / turn[l]);
        }
        r->error[i] -= r->turns[i] * turn;
    }
}

/* A sample's share of the products, or of the squares. */
static void look(Room *r, int columns) {
    if (!columns) {
        shown(r->th, r->x, r->seen, r->error);
        if (COUNTING) count(r);
        for (int i = 0; i < C; i++) r->gram[0] += r->error[i] * r->error[i];
        return;
    }
    shown_slopes(r->th, r->x, r->seen, r->D, r->error, r->c, r->direct);
    if (COUNTING) count(r);
    apply(r->shown_by, C, C_BEGIN, C_PLACE, r->c, r->by);
    scatter(r->shown_by, C, X_BEGIN, X_PLACE, r->direct);
    for (int i = 0; i < C; i++) {
        V *row = r->shown_by + i * X;
        // where nothing was measured a state that has run away counts for nothing
        for (int j = 0; j < W - 1; j++) row[j] = v_if(r->seen[Q - C + i], row[j]);
        row[W - 1] = r->error[i];
    }
    for (int i = 0; i < W; i += 2) multiply_two(r->gram, r->shown_by, i);
}

static void advance(Room *r, int columns) {
    if (columns) {
        slopes(r->th, r->x, r->u, r->D, r->next, r->a, r->b);
        apply(r->by_next, S, A_BEGIN, A_PLACE, r->a, r->by);
        scatter(r->by_next, S, B_BEGIN, B_PLACE, r->b);
        memcpy(r->by, r->by_next, sizeof r->by);
    } else
        step(r->th, r->x, r->u, r->next);
    memcpy(r->x, r->next, sizeof r->x);
}

static void march(const Given *g, int64_t block, int columns, Room *r) {
    const int64_t K = g->samples;
    int64_t member[LANES], run[LANES], pair[LANES], row[LANES];
    const int live = deal(g, block, member, run);
    EACH(l) pair[l] = member[l] * g->runs + run[l];
    // from run to run of the same members their numbers stay
    if (g->members < LANES || block % g->runs == 0) prepare(g, member, columns, r);
    load(r->x, g->start, pair, S);
    memset(r->by, 0, sizeof r->by);
    memset(r->gram, 0, sizeof r->gram);
    memset(r->turns, 0, sizeof r->turns);
    memset(r->met, 0, sizeof r->met);
    for (int i = 0; columns && START && i < S; i++) r->by[i * X + P + i] = v_same(g->spread[i]);
    for (int64_t k = 0; k < K; k++) {
        EACH(l) row[l] = ((g->apart ? member[l] * g->runs : 0) + run[l]) * K + k;
        load(r->seen, g->seen, row, Q);
        look(r, columns);
        if (k + 1 == K) break;
        EACH(l) row[l] = run[l] * (K - 1) + k;
        load(r->u, g->nodes, row, U);
        advance(r, columns);
    }
    for (int l = 0; l < live; l++)
        if (columns) {
            double *to = g->found + pair[l] * W * W;
            for (int i = 0; i < W; i++)
                for (int j = i; j < W; j++) to[i * W + j] = to[j * W + i] = r->gram[i * X + j][l];
        } else
            g->found[pair[l]] = r->gram[0][l];
}

#define ARGUMENT(i) ((XLA_FFI_Buffer *)frame->args.args[i])

static XLA_FFI_Error *called(XLA_FFI_CallFrame *frame, int columns) {
    if (frame->extension_start && frame->extension_start->type == XLA_FFI_Extension_Metadata) {
        XLA_FFI_Metadata *metadata = ((XLA_FFI_Metadata_Extension *)frame->extension_start)->metadata;
        metadata->api_version.major_version = XLA_FFI_API_MAJOR;
        metadata->api_version.minor_version = XLA_FFI_API_MINOR;
        return NULL;
    }
    const XLA_FFI_Buffer *start = ARGUMENT(2), *seen = ARGUMENT(4);
    const double *data[9] = {0};
    for (int i = 0; i < (columns ? 9 : 6); i++) data[i] = ARGUMENT(i)->data;
    const Given given = {data[0], data[1], data[2], data[3], data[4], data[5], data[6], data[7], data[8],
                         start->dims[0], start->dims[1], seen->dims[2], seen->dims[0] > 1,
                         ((XLA_FFI_Buffer *)frame->rets.rets[0])->data};
    Room *room = aligned_alloc(sizeof(V), sizeof(Room));
    for (int64_t block = 0, count = blocks(&given); block < count; block++) march(&given, block, columns, room);
    free(room);
    return NULL;
}

XLA_FFI_Error *squares(XLA_FFI_CallFrame *frame) { return called(frame, 0); }
XLA_FFI_Error *products(XLA_FFI_CallFrame *frame) { return called(frame, 1); }
