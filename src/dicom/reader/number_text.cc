/* Text values by DICOM's grammar, in any locale. */
#include "dicom/reader/dcmtk_attributes.hpp"

#include <charconv>

namespace
{

/* A whole number or decimal number, which may begin with a plus; the value is left alone where it is none. from_chars
 * alone would accept "inf" and "nan". */
template <typename Number> bool parse_whole(std::string_view text, const char *letters, Number *value)
{
    text = cts_without_padding(text);
    if (text.size() > 64 || text.find_first_not_of(letters) != std::string_view::npos)
        return false;
    if (text.size() > 1 && text[0] == '+' && text[1] != '-')
        text.remove_prefix(1);
    const char *const end = text.data() + text.size();
    Number number = 0;
    const auto result = std::from_chars(text.data(), end, number);
    const bool is_whole = result.ec == std::errc() && result.ptr == end;
    *value = is_whole ? number : *value;
    return is_whole;
}

} // namespace

std::string_view cts_without_padding(std::string_view text)
{
    while (!text.empty() && (text.back() == ' ' || text.back() == '\0'))
        text.remove_suffix(1);
    while (!text.empty() && text.front() == ' ')
        text.remove_prefix(1);
    return text;
}

bool cts_parse_ds(const char *text, size_t n, double *values, int n_values)
{
    std::string_view rest(text, n);
    for (int i = 0; i < n_values; i++) {
        const size_t end = rest.find('\\');
        if ((end == std::string_view::npos) != (i == n_values - 1) ||
            !parse_whole(rest.substr(0, end), "0123456789+-.eE", &values[i]))
            return false;
        if (end != std::string_view::npos)
            rest.remove_prefix(end + 1);
    }
    return true;
}

bool cts_parse_is(const char *text, size_t n, int *value)
{
    return parse_whole(std::string_view(text, n), "0123456789+-", value);
}
