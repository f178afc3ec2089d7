/* Deflate of filtered rows: runs of one byte (matches at distance 1), the rest as literals, one Huffman code a block.
 *
 * A general packer is not worth its time here: the low bytes of a render are noise, the high bytes of its filtered rows
 * are zeros, and matches other than runs hardly save anything. Measured with ten renders of 1024 x 1024 pixels, 16 bits
 * a sample, in strips, against ISA-L's level 1: ISA-L level 3 takes 2.5 times as long, libdeflate's level 1 4.0 times,
 * zlib's level 1 10 times, zlib's Z_RLE 6.2 times, its Z_HUFFMAN_ONLY 9.5 times and 1.24 times as many bytes; this one
 * takes 0.9 times as long and makes 0.99 times as many bytes.
 *
 * ISA-L 2.30 is no choice: its levels 0 to 2 hash the third byte of a stream with a register that holds the address of
 * the stream's state, so that now and then a match is lost and a file has other bytes; its level 3 chooses its search
 * by processor. Here nothing but the input has a say, on every processor. */
#include "output/export/deflate.h"

#include <endian.h>
#include <stdlib.h>
#include <string.h>

enum {
    /* a literal zero takes 1 or 2 bits, so shorter runs gain nothing; cts_deflate_max_runs() depends on it */
    MIN_RUN = 4,
    MAX_RUN = 258, /* of the format */
    END_OF_BLOCK = 256,
    N_SYMBOLS = 286, /* literals, end of block, lengths */
    MAX_BITS = 12,   /* of a symbol's code: four of them fit behind 7 bits into 64; the format allows 15 */
    BITS_MASK = 15,
};

/* First symbol of a run of `length` bytes; *extra: the remainder of the length, in *n_extra bits. */
static int length_symbol(unsigned length, unsigned *extra, int *n_extra)
{
    const unsigned l = length - 3;
    *extra = 0;
    *n_extra = 0;
    if (length == MAX_RUN)
        return 285;
    if (l < 8)
        return 257 + (int)l;
    *n_extra = 29 - __builtin_clz(l);
    *extra = l & ((1u << *n_extra) - 1);
    return 257 + 4 * *n_extra + (int)(l >> *n_extra);
}

static uint32_t load32(const uint8_t *from)
{
    uint32_t v;
    memcpy(&v, from, sizeof v);
    return v;
}

/* Number of bytes from p on that equal p[-1], at most n; the first MIN_RUN are known to be equal. */
static uint32_t run_length(const uint8_t *p, size_t n)
{
    const size_t most = n < MAX_RUN ? n : MAX_RUN;
    const uint32_t four = load32(p);
    size_t length = MIN_RUN;
    while (length + 4 <= most && load32(p + length) == four)
        length += 4;
    while (length < most && p[length] == p[-1])
        length++;
    return (uint32_t)length;
}

/* Lists the runs of n bytes, ended by one of length 0 at n, and counts the symbols that the block will hold. */
static void find_runs(const uint8_t *bytes, size_t n, CtsByteRun *runs, uint32_t counts[N_SYMBOLS])
{
    /* Four interleaved histograms, since equal neighbours would make each increment depend on the one before. */
    uint32_t literals[4][256] = {0};
    size_t i = 0;
    memset(counts, 0, N_SYMBOLS * sizeof *counts);
    if (n > 0)
        literals[0][bytes[i++]]++;
    while (i + MIN_RUN <= n) {
        if (load32(bytes + i) != load32(bytes + i - 1)) {
            literals[i % 4][bytes[i]]++;
            i++;
            continue;
        }
        unsigned extra;
        int n_extra;
        *runs = (CtsByteRun){(uint32_t)i, run_length(bytes + i, n - i)};
        counts[length_symbol(runs->length, &extra, &n_extra)]++;
        i += runs++->length;
    }
    for (; i < n; i++)
        literals[0][bytes[i]]++;
    *runs = (CtsByteRun){(uint32_t)n, 0};
    for (int b = 0; b < 256; b++)
        counts[b] = literals[0][b] + literals[1][b] + literals[2][b] + literals[3][b];
    counts[END_OF_BLOCK] = 1;
}

static int compare_keys(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Depths of the Huffman tree of n weights, the smallest first. */
static void tree_depths(const uint64_t *weights, int n, int *depths)
{
    uint64_t weight[2 * N_SYMBOLS];
    int parent[2 * N_SYMBOLS], depth[2 * N_SYMBOLS];
    int leaf = 0, node = n; /* the smallest of either that has no parent */
    memcpy(weight, weights, (size_t)n * sizeof *weights);
    for (int made = n; made < 2 * n - 1; made++) {
        weight[made] = 0;
        for (int child = 0; child < 2; child++) {
            const int smallest = leaf < n && (node == made || weight[leaf] <= weight[node]) ? leaf++ : node++;
            weight[made] += weight[smallest];
            parent[smallest] = made;
        }
    }
    depth[2 * n - 2] = 0;
    for (int i = 2 * n - 3; i >= 0; i--)
        depth[i] = depth[parent[i]] + 1;
    memcpy(depths, depth, (size_t)n * sizeof *depths);
}

/* Lengths of the symbols' codes, 0 for unused symbols. Codes longer than MAX_BITS are shortened; then the rarest
 * symbols get longer codes until Kraft's inequality holds, and the most frequent ones shorter codes while it does. */
static void code_lengths(const uint32_t counts[N_SYMBOLS], uint8_t lengths[N_SYMBOLS])
{
    enum { ALL = 1 << MAX_BITS };
    uint64_t keys[N_SYMBOLS], weights[N_SYMBOLS];
    int bits[N_SYMBOLS], n = 0, used = 0;
    for (int s = 0; s < N_SYMBOLS; s++)
        if (counts[s] > 0)
            keys[n++] = (uint64_t)counts[s] << 9 | (uint64_t)s;
    qsort(keys, (size_t)n, sizeof *keys, compare_keys); /* no two are equal: every qsort() gives the same order */
    for (int i = 0; i < n; i++)
        weights[i] = keys[i] >> 9;
    tree_depths(weights, n, bits);
    for (int i = 0; i < n; i++) {
        bits[i] = bits[i] < 1 ? 1 : bits[i] > MAX_BITS ? MAX_BITS : bits[i];
        used += ALL >> bits[i];
    }
    for (int i = 0; used > ALL; i++)
        for (; used > ALL && bits[i] < MAX_BITS; used -= ALL >> bits[i])
            bits[i]++;
    for (int i = n - 1; i >= 0; i--)
        for (; bits[i] > 1 && used + (ALL >> bits[i]) <= ALL; bits[i]--)
            used += ALL >> bits[i];
    memset(lengths, 0, N_SYMBOLS);
    for (int i = 0; i < n; i++)
        lengths[keys[i] & 511] = (uint8_t)bits[i];
}

static uint32_t reversed(uint32_t code, int n_bits)
{
    uint32_t r = 0;
    for (int b = 0; b < n_bits; b++)
        r |= (code >> b & 1) << (n_bits - 1 - b);
    return r;
}

/* Each symbol's code, first bit lowest, shifted above its length, which is in the 4 lowest bits. */
static void make_codes(const uint8_t lengths[N_SYMBOLS], uint32_t codes[N_SYMBOLS])
{
    uint32_t next = 0;
    for (int length = 1; length <= MAX_BITS; length++, next <<= 1)
        for (int s = 0; s < N_SYMBOLS; s++)
            if (lengths[s] == length)
                codes[s] = reversed(next++, length) << 4 | (uint32_t)length;
}

/* Bits not yet written. */
typedef struct BitWriter {
    uint64_t bits; /* the first one lowest */
    int n_bits;
    uint8_t *to;
} BitWriter;

static void put_bits(BitWriter *w, uint64_t value, int n_bits)
{
    w->bits |= value << w->n_bits;
    w->n_bits += n_bits;
}

/* Writes whole bytes; up to 7 bits stay. */
static void put_out(BitWriter *w)
{
    const uint64_t bits = htole64(w->bits);
    memcpy(w->to, &bits, sizeof bits);
    w->to += w->n_bits / 8;
    w->bits >>= w->n_bits & ~7;
    w->n_bits &= 7;
}

/* Codes' lengths could be packed too, for 40 bytes of 150: all 16 that a length can be have 4 bits. */
static void put_table(BitWriter *w, const uint8_t lengths[N_SYMBOLS])
{
    enum { REPEATS = 3, LENGTHS = 16, DISTANCE_BITS = 1 };
    put_bits(w, N_SYMBOLS - 257, 5);
    put_bits(w, 0, 5); /* one distance */
    put_bits(w, REPEATS + LENGTHS - 4, 4);
    put_bits(w, 0, 3 * REPEATS);
    put_out(w);
    for (int i = 0; i < LENGTHS; i++) {
        put_bits(w, 4, 3);
        put_out(w);
    }
    for (int s = 0; s < N_SYMBOLS; s++) {
        put_bits(w, reversed(lengths[s], 4), 4);
        put_out(w);
    }
    put_bits(w, reversed(DISTANCE_BITS, 4), 4);
    put_out(w);
}

static void put_symbols(BitWriter *w, const uint8_t *bytes, size_t n, const CtsByteRun *run,
                        const uint32_t codes[N_SYMBOLS])
{
    for (size_t i = 0;; run++) {
        for (; i + 4 <= run->first; i += 4) {
            for (int k = 0; k < 4; k++)
                put_bits(w, codes[bytes[i + (size_t)k]] >> 4, codes[bytes[i + (size_t)k]] & BITS_MASK);
            put_out(w);
        }
        for (; i < run->first; i++) {
            put_bits(w, codes[bytes[i]] >> 4, codes[bytes[i]] & BITS_MASK);
            put_out(w);
        }
        if (i == n)
            break;
        unsigned extra;
        int n_extra;
        const uint32_t code = codes[length_symbol(run->length, &extra, &n_extra)];
        put_bits(w, code >> 4, code & BITS_MASK);
        put_bits(w, extra, n_extra);
        put_bits(w, 0, 1); /* distance 1 */
        put_out(w);
        i += run->length;
    }
    put_bits(w, codes[END_OF_BLOCK] >> 4, codes[END_OF_BLOCK] & BITS_MASK);
    put_out(w);
}

size_t cts_deflate(const uint8_t *bytes, size_t n, bool last, CtsByteRun *runs, uint8_t *packed)
{
    uint32_t counts[N_SYMBOLS], codes[N_SYMBOLS];
    uint8_t lengths[N_SYMBOLS];
    BitWriter w = {.to = packed};
    find_runs(bytes, n, runs, counts);
    code_lengths(counts, lengths);
    make_codes(lengths, codes);
    put_bits(&w, last, 1);
    put_bits(&w, 2, 2); /* a block with a code table of its own */
    put_table(&w, lengths);
    put_symbols(&w, bytes, n, runs, codes);
    if (!last)
        put_bits(&w, 0, 3); /* a stored block, which starts on a byte */
    if (w.n_bits > 0) {
        w.n_bits = (w.n_bits + 7) & ~7;
        put_out(&w);
    }
    if (!last) {
        memcpy(w.to, "\x00\x00\xff\xff", 4); /* and is empty */
        w.to += 4;
    }
    return (size_t)(w.to - packed);
}
