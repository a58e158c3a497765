// What tsc cannot know of the page: the library it loads, its own events, and that its HTML has what it looks for.

declare const uPlot: any;

interface Event { readonly detail?: any; readonly data?: any }
interface EventTarget { closest?: any }
interface ParentNode { querySelector(selectors: string): any; querySelectorAll(selectors: string): NodeListOf<any> }
interface Element { closest(selectors: string): any }
