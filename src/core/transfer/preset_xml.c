/* Slicer's presets.xml (or a scene): the requested VolumeProperty element. */
#include "core/transfer/preset_read.h"

#include <expat.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct XmlSearch {
    XML_Parser parser;
    const char *which; /* NULL: the only one */
    CtsVtkText values[CTS_VTK_N];
    int n_found, n_chosen;
    char name[64];
    char names[500]; /* of all found, for the message */
    const char *why; /* the search was given up; or NULL */
} XmlSearch;

static const char *attribute(const char *const *attributes, const char *name)
{
    for (; *attributes; attributes += 2)
        if (!strcmp(attributes[0], name))
            return attributes[1];
    return NULL;
}

static void give_up_search(XmlSearch *search, const char *why)
{
    search->why = why;
    XML_StopParser(search->parser, XML_FALSE);
}

/* Line that is being read. The older function is deprecated from expat 2.9 on. */
static int line_of(XML_Parser parser)
{
#if XML_MAJOR_VERSION > 2 || XML_MINOR_VERSION >= 9
    return (int)XML_GetCurrentLineNumber64(parser);
#else
    return (int)XML_GetCurrentLineNumber(parser);
#endif
}

static void on_element(void *user, const char *element, const char **attributes)
{
    XmlSearch *search = user;
    if (strcmp(element, "VolumeProperty"))
        return;
    const char *name = attribute(attributes, "name");
    search->n_found++;
    const size_t n = strlen(search->names);
    snprintf(search->names + n, sizeof search->names - n, " %.60s", name ? name : "(no name)");
    if (search->which && (!name || strcasecmp(name, search->which)))
        return;
    if (search->n_chosen++)
        return;
    snprintf(search->name, sizeof search->name, "%s", name ? name : "");
    for (int i = 0; i < CTS_VTK_N; i++) {
        const char *const text = attribute(attributes, cts_vtk_names[i]);
        search->values[i] = (CtsVtkText){text ? strdup(text) : NULL, line_of(search->parser)};
        if (text && !search->values[i].text)
            give_up_search(search, "out of memory");
    }
}

/* Presets need no document type, and entities allow attacks by exponential expansion. */
static void on_doctype(void *user, const char *name, const char *sysid, const char *pubid, int has_internal_subset)
{
    (void)name, (void)sysid, (void)pubid, (void)has_internal_subset;
    give_up_search(user, "a document type is not allowed");
}

CtsStatus cts_preset_from_xml(const char *text, size_t size, const char *name, const char *which, CtsPreset *preset,
                              CtsError *err)
{
    CtsStatus st = CTS_OK;
    XmlSearch search = {.which = which};
    search.parser = XML_ParserCreate(NULL);
    if (!search.parser)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    XML_SetUserData(search.parser, &search);
    XML_SetElementHandler(search.parser, on_element, NULL);
    XML_SetStartDoctypeDeclHandler(search.parser, on_doctype);
    if (XML_Parse(search.parser, text, (int)size, 1) != XML_STATUS_OK) {
        st = cts_fail(err, CTS_ERR_PRESET, "%s: line %d: %s", name, line_of(search.parser),
                      search.why ? search.why : XML_ErrorString(XML_GetErrorCode(search.parser)));
        goto end;
    }
    if (!search.n_found)
        st = cts_fail(err, CTS_ERR_PRESET, "%s: holds no VolumeProperty", name);
    else if (which && !search.n_chosen)
        st = cts_fail(err, CTS_ERR_PRESET, "%s: holds no preset %.60s; there are:%s", name, which, search.names);
    else if (search.n_chosen > 1)
        st = cts_fail(err, CTS_ERR_PRESET, "%s: holds %d presets (take one by adding #NAME:%s)", name, search.n_found,
                      search.names);
    if (st)
        goto end;
    if (!(st = cts_preset_from_vtk(name, search.values, preset, err)))
        cts_preset_set_name(preset, search.name);
end:
    for (int i = 0; i < CTS_VTK_N; i++)
        free((char *)search.values[i].text);
    XML_ParserFree(search.parser);
    return st;
}
