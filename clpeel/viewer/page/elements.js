/** Return a new element with these properties and children. */
export function element (tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties)
  made.append(...children)
  return made
}

/** Return the one element that the selector means, below the root. */
export function find (selector, root = document) {
  return root.querySelector(selector)
}
