/* What a client can take: the Accept header, or `accept=`, which stands in for it (PS3.18 8.3.3.1). */
#ifndef CTS_SERVE_MEDIA_TYPE_H
#define CTS_SERVE_MEDIA_TYPE_H

/* The place of the media type among n that the list likes best, of equals the first; -1 where it takes none. An empty
 * list, or NULL, takes all. */
int cts_accept_best(const char *list, const char *const *media_types, int n);

#endif
