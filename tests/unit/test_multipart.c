/* Multipart bodies, received in pieces of every length, and with a peer's possible mistakes. */
#include "unit.h"

#include "dicom/net/multipart.h"
#include "dicom/net/peer.h"
#include <stdlib.h>
#include <string.h>

typedef struct Parts {
    char text[4096]; /* "<" part ">" for each */
    size_t n;
} Parts;

static CtsStatus begin(void *context, CtsError *err)
{
    Parts *p = context;
    p->text[p->n++] = '<';
    return CTS_OK;
}

static CtsStatus take(void *context, const void *bytes, size_t n, CtsError *err)
{
    Parts *p = context;
    assert_true(p->n + n < sizeof p->text);
    memcpy(p->text + p->n, bytes, n);
    p->n += n;
    return CTS_OK;
}

static CtsStatus end(void *context, CtsError *err)
{
    Parts *p = context;
    p->text[p->n++] = '>';
    return CTS_OK;
}

static CtsStatus split(const char *type, const char *body, size_t n, size_t piece, Parts *parts)
{
    CtsMultipart *m = malloc(sizeof *m);
    CtsError err;
    memset(parts, 0, sizeof *parts);
    const CtsPartSink sink = {begin, take, end, parts};
    CtsStatus st = cts_multipart_start(m, type, &sink, &err);
    for (size_t i = 0; i < n && !st; i += piece) {
        /* Its own copy, so that a read past the end is detected. */
        const size_t length = n - i < piece ? n - i : piece;
        char *copy = malloc(length);
        memcpy(copy, body + i, length);
        st = cts_multipart_feed(m, copy, length, &err);
        free(copy);
    }
    if (!st)
        st = cts_multipart_finish(m, &err);
    free(m);
    return st;
}

static const char type[] = "multipart/related; type=\"application/dicom\"; boundary=\"-b-\"";

static void test_pieces(void **state)
{
    static const struct {
        const char *body, *parts;
    } cases[] = {
        {"\r\n---b-\r\n\r\none\r\n---b---\r\n", "<one>"},
        {"---b-\r\nA: b\r\nC: d\r\n\r\none\r\n---b-\r\n\r\n\r\n---b---", "<one><>"},
        {"pre\r\n---b\r\n---b- \t\r\n\r\n\r\r\n\r\n--\r\n---b\r\n\r\n---b---post", "<\r\r\n\r\n--\r\n---b\r\n>"},
        {"---b---", ""},
        {"---b-\r\n\r\n---b-\r\n---b---", "<---b->"}, /* a delimiter begins a line */
    };
    Parts parts;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (size_t piece = 1; piece < 80; piece++) {
            assert_int_equal(split(type, cases[i].body, strlen(cases[i].body), piece, &parts), CTS_OK);
            assert_string_equal(parts.text, cases[i].parts);
        }
}

static void test_damage(void **state)
{
    static const char body[] = "\r\n---b-\r\nA: b\r\n\r\none\r\n---b-\r\n\r\ntwo\r\n---b---";
    char long_header[CTS_MAX_PART_HEADER + 100] = "\r\n---b-\r\n";
    const size_t n_whole = strlen(body);
    Parts parts;
    for (size_t n = 0; n < n_whole; n++)
        assert_int_equal(split(type, body, n, 7, &parts), CTS_ERR_READ);
    memset(long_header + strlen(long_header), 'x', sizeof long_header - strlen(long_header));
    assert_int_equal(split(type, long_header, sizeof long_header, 100, &parts), CTS_ERR_READ);
    assert_int_equal(split(type, "\r\n---b-junk\r\n\r\n", 15, 3, &parts), CTS_ERR_READ);
    assert_int_equal(split(type, "\r\n---b--x\r\n\r\none\r\n---b---", 27, 3, &parts), CTS_ERR_READ);
    static const char *const types[] = {"",
                                        "text/html",
                                        "multipart/related",
                                        "multipart/related; boundary=",
                                        "multipart/related; boundary=\"\"",
                                        "multipart/related; type=x; bound=y"};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        assert_int_equal(split(types[i], body, n_whole, 10, &parts), CTS_ERR_READ);
}

static void test_peers(void **state)
{
    CtsPeer peer;
    CtsError err;
    assert_int_equal(cts_peer_parse("MY PACS@pacs-1.example:104", &peer, &err), CTS_OK);
    assert_false(peer.web);
    assert_string_equal(peer.aet, "MY PACS");
    assert_string_equal(peer.host, "pacs-1.example");
    assert_int_equal(peer.port, 104);
    assert_int_equal(cts_peer_parse("https://host:8443/dicom-web//", &peer, &err), CTS_OK);
    assert_true(peer.web);
    assert_string_equal(peer.url, "https://host:8443/dicom-web");
    static const char *const bad[] = {"",
                                      "@",
                                      "A@",
                                      "A@h",
                                      "A@h:",
                                      "A@h:x",
                                      "A@h:1x",
                                      "A@h:65536",
                                      "A@h:-1",
                                      " A@h:1",
                                      "A @h:1",
                                      "A\\B@h:1",
                                      "A@h/../x:1",
                                      "A@h%n:1",
                                      "12345678901234567@h:1",
                                      "http:///x",
                                      "http://u:p@host/",
                                      "http://host/a b",
                                      "https://host/x#y"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_int_equal(cts_peer_parse(bad[i], &peer, &err), CTS_ERR_USAGE);
    assert_int_equal(cts_peer_parse("http://u:secret@host/", &peer, &err), CTS_ERR_USAGE);
    assert_null(strstr(err.text, "secret"));
    assert_true(cts_uid_is_valid("1.2.840.10008"));
    static const char *const no_uids[] = {
        "",     ".",     "1.",  ".1",
        "1..2", "1.2/3", "1.a", "1.22222222222222222222222222222222222222222222222222222222222222222"};
    for (size_t i = 0; i < sizeof no_uids / sizeof *no_uids; i++)
        assert_false(cts_uid_is_valid(no_uids[i]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pieces),
        cmocka_unit_test(test_damage),
        cmocka_unit_test(test_peers),
    };
    return cmocka_run_group_tests_name("multipart", tests, NULL, NULL);
}
